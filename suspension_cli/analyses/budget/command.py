"""`pendsus budget`: motion of the mirror by cause, from the ground on."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import (
    Analysis,
    Document,
    Result,
    Run,
    Settings,
    as_number,
    describe_mirrors,
    name_mirrors,
    plain,
)
from suspension_cli.analyses.options import option
from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.errors import Fault, InputError, escape_unprintable, format_value
from suspension_cli.grids import decade_points, parse_frequencies

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from suspension_cli.analyses.budget.ground import Motion
    from suspension_cli.analyses.budget.solve import Budget, Requirement
    from suspension_cli.analyses.budget.table import Table
    from suspension_cli.design.schema import Design
    from suspension_cli.linear.system import LinearSystem
    from suspension_cli.models.registry import Choice
    from suspension_cli.scene.arrays import Array

GROUND = "nhnm"
"""Ground of a noisy site: a requirement that is met there is met anywhere."""
PETERSON = ("nlnm", "nhnm")
HIGHEST = 10.0
"""Highest frequency of Peterson's models, Hz."""


class BudgetAnalysis(Analysis):
    """Compute the motion of the mirror by cause, with cumulative RMS.

    The causes are motions of the support, noise of sensors and actuators of the design's loops, and
    thermal noise; the loops are closed. For the RMS, points around resonances are added to the
    frequencies. Writes DIR/NAME-budget.h5 and .png.

    Example: pendsus budget my.toml --ground nlnm --ground z=site.csv --requirement goal.csv

    Example: pendsus budget my.toml --ground aligo-bsc --arm 4000 --mirrors 4

    Returns
    -------
    Result
        Its `data` is a list of `analyses.budget.solve.Budget`, one for each output, with
        `amplitude` (f,) in m/sqrt(Hz) or rad/sqrt(Hz), `parts` by cause, `rms` and `rms_velocity`
        (f,) above each frequency, and `requirement`.

    Raises
    ------
    InputError
        If the closed loop is unstable, or a table has faults.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.budget(sus.example("double"), frequency=[1.0, 10.0], ground=["nlnm"])
    >>> found.data[0].cause
    ('ground.x', 'ground.y', 'ground.z', 'thermal')
    """

    name = "budget"
    result_type = "analyses.budget.solve.Budgets"
    arguments = (options.DESIGN,)
    parameters = (
        options.signals("output", options.MOTIONS, "x, pitch and yaw of the mirror"),
        option(
            "--ground",
            multiple=True,
            default=(GROUND,),
            metavar="[COORDINATES=]SOURCE",
            help=(
                "Motion of the support: nlnm (quiet ground), nhnm (noisy ground), aligo-isi"
                " (or aligo-bsc) and aligo-ham (platforms), a CSV file, or none; x,y=SOURCE for"
                " some coordinates (repeatable)."
            ),
        ),
        option(
            "--isolation",
            multiple=True,
            metavar="[COORDINATES=]FILE",
            help="CSV of a platform's transmissibility, a factor on the ground (repeatable).",
        ),
        option(
            "--requirement",
            "requirements",
            multiple=True,
            metavar="[SIGNAL=]FILE",
            help=(
                "CSV of the required spectrum of an output, by default the first; with --arm also"
                " in strain/sqrt(Hz) (repeatable)."
            ),
        ),
        options.frequencies("0.01:100:2000"),
        *options.BEAM,
        options.ACCURACY,
        *options.WRITING,
    )

    def solve(self, run: Run) -> Result:
        """Compute the budget of every output."""
        import numpy as np

        from suspension_cli.analyses.budget import noise
        from suspension_cli.analyses.budget import solve as budget
        from suspension_cli.analyses.thermal import solve as thermal
        from suspension_cli.design.derive import mirror
        from suspension_cli.models import registry

        setting, design, folder = run.setting, run.design, Path(run.source.file).parent
        motions, grid, notes = _ground(setting, folder)
        outputs = list(setting["outputs"]) or [
            f"{mirror(design)}.{dof}" for dof in ("x", "pitch", "yaw")
        ]
        requirements = _requirements(setting, outputs, folder, grid)
        choice, model, warm = _model(run, grid, outputs, notes)
        parsed = thermal.parse_outputs(model, outputs, setting["arm"])
        heavy = choice.model.has_wire_mass
        light = registry.BEAM.system(design) if heavy else model
        poles = noise.find_stable_poles(design, light)
        if heavy:
            poles = np.append(poles, noise.find_wire_modes(model, float(grid[-1])))
        temperature = design.constants.temperature if warm else None
        plant = noise.build_plant(design, model)
        noises = noise.Noises(plant, parsed, motions, temperature, setting["mirrors"])
        if not noises.cause:
            raise _error("--ground", "leaves no cause of motion", "give a ground, or loss angles")
        for note in notes:
            run.log.warn(note)
        added = ":" in setting["frequency"]
        found = budget.solve(noises, grid, poles, requirements, added=added)
        for one in found:
            if np.isinf(one.rms).any():
                run.log.warn(
                    f"{one.output}: the RMS is infinite, as a resonance without loss is driven;"
                    " give loss angles or dampers"
                )
        extra = describe_mirrors(setting)
        if setting["arm"]:
            extra["tilt_rad"] = thermal.compute_arm_tilt(setting["arm"])
        return Result(self, run.source, choice, found, extra, command=run.command)

    def parse_names(
        self, design: Design, stages: tuple[str, ...], known: tuple[str, ...]
    ) -> Iterator[Callable[[], object]]:
        """Return nothing: `damp` parses the signals of the loops."""
        return iter(())

    def document(self, result: Result) -> Document:
        """Return the budget of the first output flat, and those of the others."""
        budgets: list[Budget] = result.data
        first, *others = [_document(one) for one in budgets]
        head = {"frequency_hz": budgets[0].frequency.tolist()}
        ground = {"ground": _sources(budgets[0])}
        return head | first | {"other_outputs": others} | ground | result.extra

    def text(self, result: Result) -> str:
        """Return a table per output: RMS and amplitude spectral densities by cause."""
        first = result.data[0]
        ground = describe_ground(_sources(first), float(first.frequency[-1]))
        lines = [result.choice.line, f"ground: {ground}"]
        for one in result.data:
            low, high = one.frequency[0], one.frequency[-1]
            shown = decade_points(one.frequency)
            span = f"{low:.4g}" + (f" to {high:.4g}" if high > low else "")
            tilt = result.extra.get("tilt_rad", 0.0) * (one.output.partition("@")[0][-2:] == ".x")
            along = f" along a beam that rises by {1e6 * tilt:.3g} urad" if tilt else ""
            lines += ["", f"{one.output}{along}{name_mirrors(result)}, {span} Hz"]
            columns = {"cause": "", f"RMS\n{one.unit}": ".3e"}
            columns[f"RMS velocity\n{one.unit}/s"] = ".3e"
            columns |= {f"{one.frequency[n]:.4g} Hz\n{one.unit}/sqrt(Hz)": ".3e" for n in shown}
            rows: list[tuple[float | str | None, ...]] = [
                ("all", _rms(one.rms[0]), _rms(one.rms_velocity[0]), *one.amplitude[shown])
            ]
            order = sorted(range(len(one.cause)), key=lambda n: -one.density[n].max())
            for n in order:
                if one.density[n].any():
                    squares = [_rms(s[n, 0] ** 0.5) for s in (one.square, one.square_velocity)]
                    rows.append((one.cause[n], *squares, *one.density[n, shown] ** 0.5))
            lines.append(tables.render(columns, rows))
            none = [one.cause[n] for n in order if not one.density[n].any()]
            if none:
                lines.append(f"  no contribution of {', '.join(none)}")
            if one.requirement is not None:
                lines.append(f"  {describe_requirement(one.requirement)}")
        return "\n".join(lines)

    def figures(self, result: Result, setting: Settings) -> dict[str, Figure]:
        """Draw a panel per output."""
        from suspension_cli.analyses.budget import picture
        from suspension_cli.drawing.style import name_neglected

        return {
            "": name_neglected(
                picture.draw(result.data, result.subtitle + name_mirrors(result)), result.choice
            )
        }


def _sources(one: Budget) -> dict[str, str]:
    pairs = zip(one.cause, one.source, strict=True)
    return {cause.partition(".")[2]: source for cause, source in pairs if source}


def _rms(value: float) -> float | str:
    return "infinite" if value == math.inf else float(value)


def _document(one: Budget) -> Document:
    """Return one output as JSON, without its frequencies."""
    pairs = [*zip(one.cause, one.square, one.square_velocity, strict=True)]
    result: Document = {
        "output": one.output,
        "unit": f"{one.unit}/sqrt(Hz)",
        "displacement_asd": one.amplitude.tolist(),
        "contributions": {name: part.tolist() for name, part in one.parts.items()},
        "rms": as_number(one.rms[0]),
        "rms_velocity": as_number(one.rms_velocity[0]),
        "rms_by_cause": {name: as_number(square[0] ** 0.5) for name, square, _ in pairs},
        "rms_velocity_by_cause": {name: as_number(square[0] ** 0.5) for name, _, square in pairs},
        "cumulative_rms": plain(one.rms),
        "cumulative_rms_velocity": plain(one.rms_velocity),
    }
    if one.requirement is not None:
        found = one.requirement
        result["requirement"] = {
            "file": found.name,
            "met": found.met,
            "margin": as_number(found.margin),
            "at_hz": found.at,
            "exceeded_hz": [list(span) for span in found.exceeded],
        }
    return result


def describe_requirement(found: Requirement) -> str:
    """Describe in one line whether a requirement is met, with its margin."""
    name = escape_unprintable(Path(found.name).name)
    if found.met:
        size = f"{found.margin:.3g}" if math.isfinite(found.margin) else "infinite"
        return f"requirement {name}: met, smallest margin {size} at {found.at:.4g} Hz"
    spans = [
        f"{low:.4g} Hz" if low == high else f"{low:.4g} to {high:.4g} Hz"
        for low, high in found.exceeded
    ]
    more = f" and {len(spans) - 3} more" if len(spans) > 3 else ""
    return (
        f"requirement {name}: NOT met, exceeded by a factor of {found.excess:.3g} at"
        f" {found.at:.4g} Hz; above it at {', '.join(spans[:3])}{more}"
    )


def describe_ground(names: dict[str, str], highest: float) -> str:
    """Describe the motion of the support up to a frequency in Hz."""
    sources: dict[str, list[str]] = {}
    for dof, name in names.items():
        sources.setdefault(name, []).append(dof)
    text = "; ".join(
        f"{escape_unprintable(name)} along {', '.join(dofs)}" for name, dofs in sources.items()
    )
    if highest > HIGHEST and any(name in source for name in PETERSON for source in sources):
        text += f" (known to {HIGHEST:g} Hz; above, with its acceleration at {HIGHEST:g} Hz)"
    return text or "none"


def _ground(setting: Settings, folder: Path) -> tuple[dict[str, Motion], Array, list[str]]:
    """Return the motions of the support, the grid within their ranges, and warnings."""
    import numpy as np

    from suspension_cli.analyses.budget import ground

    notes: list[str] = []
    motions = ground.parse(setting["ground"], setting["isolation"], folder)
    frequency = parse_frequencies(setting["frequency"])
    grid = np.unique(np.array(frequency))
    low = max([motion.low for motion in motions.values()], default=0.0)
    high = min([motion.high for motion in motions.values()], default=math.inf)
    name = next((m.name for m in motions.values() if m.low > grid[0] or m.high < grid[-1]), "")
    if name:
        within = grid[(grid >= low) & (grid <= high)]
        if not len(within):
            problem = f"has no frequency from {low:g} to {high:g} Hz, where the ground is known"
            remedy = "move it, or give a table of the ground there"
            raise _error("--frequency", problem, remedy, setting["frequency"])
        ends = [end for end in (low, high) if grid[0] < end < grid[-1]]
        grid = np.union1d(within, ends) if ":" in setting["frequency"] else within
        notes.append(
            f"frequencies are cut to {grid[0]:.4g} to {grid[-1]:.4g} Hz, the range of {name}"
        )
    return motions, grid, notes


def _requirements(
    setting: Settings, outputs: Sequence[str], folder: Path, grid: Array
) -> dict[int, Table]:
    from suspension_cli.analyses.budget import ground, solve, table

    result: dict[int, Table] = {}
    for text in setting["requirements"]:
        name, equals, source = text.rpartition("=")
        if equals and name.strip() not in outputs:
            remedy = f"give one of {', '.join(outputs)}, or add --output {name.strip()}"
            raise _error("--requirement", "names no output", remedy, text)
        number = outputs.index(name.strip()) if equals else 0
        unit = "rad" if outputs[number].partition("@")[0].endswith(DOFS[3:]) else "m"
        path = ground.find(source.strip(), folder, "--requirement")
        found = table.read(path, unit, setting["arm"])
        if len(found.column) != 1:
            problem = f"has {len(found.column)} columns of values instead of one"
            remedy = "write two columns, frequency and asd, and a file per output"
            raise InputError([Fault("", problem, remedy)], found.file)
        if not solve.overlaps(grid, found):
            problem = (
                f"is from {found.frequency[0]:g} to {found.frequency[-1]:g} Hz, outside"
                f" {grid[0]:g} to {grid[-1]:g} Hz of the budget"
            )
            raise InputError([Fault("", problem, "move --frequency there")], found.file)
        result[number] = found
    return result


def _model(
    run: Run, grid: Array, outputs: Sequence[str], notes: list[str]
) -> tuple[Choice, LinearSystem, bool]:
    """Choose the model; tell whether it has thermal noise. Warnings are added to `notes`."""
    from suspension_cli.analyses import model_choice
    from suspension_cli.analyses.check.lossless import describe_lossless, find_lossless
    from suspension_cli.analyses.thermal import solve as thermal
    from suspension_cli.linear import signals
    from suspension_cli.models import registry
    from suspension_cli.models.choice import Transfer

    source, setting = run.source, run.setting
    wanted = setting["fidelity"]
    try:
        choice, model = thermal.choose(source, wanted, grid, outputs, setting["arm"])
        warm = True
    except InputError as error:
        warm = False

        def request(system: LinearSystem) -> Transfer:
            known = signals.bodies_with_signals(system)
            inputs = [signals.parse_input(f"{SUPPORT}.{dof}", known) for dof in "xz"]
            return Transfer(inputs, thermal.parse_outputs(system, outputs, setting["arm"]), grid)

        choice, model = model_choice.choose(source, wanted, request)
        fault = error.faults[0]
        why = (
            f"the {choice.level} model does not know where along a wire its loss acts"
            if wanted != registry.AUTO
            else fault.problem
        )
        notes.append(f"{run.name}: thermal noise is left out, as {why}")
    controlled = run.design.control is not None
    model = model_choice.stable_system(source, choice, controlled, run.log, model, bends=True)
    if warm:
        lossless = find_lossless(run.design, choice.level)
        for line in describe_lossless(lossless, choice.level):
            notes.append(f"{run.name}: {line}")
    return choice, model, warm


def _error(key: str, problem: str, remedy: str, value: str | None = None) -> Exception:
    return InputError([Fault(key, problem, remedy, value and format_value(value))])


ANALYSIS = BudgetAnalysis()
