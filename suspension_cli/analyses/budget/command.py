"""`pendsus budget`: motion of the mirror by cause, from the ground on."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import (
    Analysis,
    Document,
    Result,
    Run,
    Settings,
    describe_mirrors,
    name_mirrors,
    table,
)
from suspension_cli.analyses.options import option
from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.errors import (
    InputError,
    attribute_faults_to,
    escape_unprintable,
    format_value,
)
from suspension_cli.grids import decade_points, parse_frequencies, table_points

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from suspension_cli.design.schema import Design
    from suspension_cli.linear.system import LinearSystem
    from suspension_cli.models.registry import Choice
    from suspension_cli.physics.ground import Spectrum
    from suspension_cli.physics.noise_budget import Budget, Requirement
    from suspension_cli.scene.arrays import Array

GROUND = "nhnm"
"""Ground of a noisy site: a requirement that is met there is met anywhere."""
CREST = 4.0
"""Peak over RMS of a drive: Gaussian noise exceeds it for 6e-5 of the time."""
ABREAST = 6
"""Most columns of frequencies beside each other."""
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
        Its `data` is a list of `physics.noise_budget.Budget`, one for each output, with
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
    result_type = "physics.noise_budget.Budget"
    draws_neglected = True
    arguments = (options.DESIGN,)
    parameters = (
        options.signals("output", options.MOTIONS, "x, pitch and yaw of the mirror"),
        option(
            "--ground",
            multiple=True,
            default=(GROUND,),
            metavar="[COORDINATES=]SOURCE",
            help="Motion of the support: nlnm (quiet ground), nhnm (noisy ground), aligo-isi"
            " (or aligo-bsc) and aligo-ham (platforms), a CSV file, or none; x,y=SOURCE for"
            " some coordinates (repeatable).",
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
            help="CSV of the required spectrum of an output, by default the first; with --arm also"
            " in strain/sqrt(Hz) (repeatable).",
        ),
        options.frequencies("0.01:100:2000"),
        *options.BEAM,
        options.ACCURACY,
        *options.WRITING,
    )

    def solve(self, run: Run) -> Result:
        """Compute the budget of every output."""
        import numpy as np

        from suspension_cli.design.derive import mirror
        from suspension_cli.physics import local_control, noise_budget, thermal_noise
        from suspension_cli.physics.closed_loop import find_steady_poles

        setting, design, folder = run.setting, run.design, Path(run.source.file).parent
        motions, grid, notes = _ground(setting, folder)
        usual = [f"{mirror(design)}.{dof}" for dof in ("x", "pitch", "yaw")]
        outputs = list(setting["outputs"]) or usual
        requirements = _requirements(setting, outputs, folder, grid)
        choice, model, warm = _model(run, grid, outputs, notes)
        parsed = thermal_noise.parse_outputs(model, outputs, setting["arm"])
        poles = find_steady_poles(design, model, choice.model, "motion").value
        if choice.model.has_wire_mass:
            poles = np.append(poles, noise_budget.find_wire_modes(model, float(grid[-1])))
        temperature = design.constants.temperature if warm else None
        plant = local_control.build_plant(design, model)
        noises = noise_budget.Noises(plant, parsed, motions, temperature, setting["mirrors"])
        if not noises.cause:
            problem, remedy = "leaves no cause of motion", "give a ground, or loss angles"
            raise InputError.of("--ground", problem, remedy)
        found = noise_budget.solve(
            noises, grid, poles, requirements, added=":" in setting["frequency"]
        )
        notes += [
            f"{one.output}: the RMS is infinite, as a resonance without loss is driven;"
            " give loss angles or dampers"
            for one in found
            if np.isinf(one.rms).any()
        ]
        notes += [
            f"coil {one.coil}: {CREST:g} times the RMS of its drive (an assumed crest factor) is"
            f" {CREST * one.part:.3g} times its range, mostly due to {one.cause}"
            for one in found[0].drive or ()
            if CREST * one.part > 1
        ]
        for note in notes:
            run.log.warn(note)
        extra = describe_mirrors(setting)
        if setting["arm"]:
            extra["tilt_rad"] = thermal_noise.compute_arm_tilt(setting["arm"])
        return Result(self, run.source, choice, found, extra, command=run.command)

    def document(self, result: Result) -> Document:
        """Return the budget of the first output flat, and those of the others."""
        first, *others = [_document(one) for one in result.data]
        one: Budget = result.data[0]
        head = {"frequency_hz": one.frequency.tolist()}
        if one.drive is not None:
            columns = "coil force current voltage counts part_of_range=part cause"
            first["drive_rms"] = table(one.drive, columns)
        return head | first | {"other_outputs": others, "ground": _sources(one)} | result.extra

    def text(self, result: Result) -> str:
        """Return a table per output: RMS and amplitude spectral densities by cause."""
        first: Budget = result.data[0]
        low, high = first.frequency[[0, -1]]
        span = f"{low:.4g}" + (f" to {high:.4g}" if high > low else "") + " Hz"
        lines = [result.choice.line, f"ground: {_describe_ground(first)}"]
        for one in result.data:
            tilt = result.extra.get("tilt_rad", 0.0) * (one.output.partition("@")[0][-2:] == ".x")
            lines += ["", f"{one.output}{name_mirrors(result, tilt)}, {span}", *_tabulate(one)]
        if first.drive is not None:
            units = ("N", "A", "V", "counts", "of range")
            columns = {"coil": ""} | {f"RMS\n{unit}": ".3g" for unit in units}
            rows = [[*vars(one).values()] for one in first.drive]
            lines += ["", f"Drives of coils by the loops, {span}"]
            lines.append(tables.render(columns | {"mostly due to": ""}, rows))
        return "\n".join(lines)

    def figures(self, result: Result, setting: Settings) -> dict[str, Figure]:
        """Draw a panel per output."""
        from suspension_cli.analyses.budget import picture

        return {"": picture.draw(result.data, result.subtitle + name_mirrors(result))}


def _sources(one: Budget) -> dict[str, str]:
    """Names of models and files by coordinate of the support."""
    pairs = zip(one.cause, one.source, strict=True)
    return {cause.partition(".")[2]: source for cause, source in pairs if source}


def _document(one: Budget) -> Document:
    """Return one output as JSON, without its frequencies."""
    squares, velocities = one.mean_square[0], one.mean_square_velocity[0]
    result: Document = {
        "output": one.output,
        "unit": f"{one.unit}/sqrt(Hz)",
        "displacement_asd": one.amplitude.tolist(),
        "contributions": {name: part.tolist() for name, part in one.parts.items()},
        "rms": one.rms[0],
        "rms_velocity": one.rms_velocity[0],
        "rms_by_cause": dict(zip(one.cause, squares**0.5, strict=True)),
        "rms_velocity_by_cause": dict(zip(one.cause, velocities**0.5, strict=True)),
        "cumulative_rms": one.rms,
        "cumulative_rms_velocity": one.rms_velocity,
    }
    if (found := one.requirement) is not None:
        result["requirement"] = {
            "file": found.name,
            "met": found.met,
            "margin": found.margin,
            "at_hz": found.at,
            "exceeded_hz": found.exceeded,
        }
    return result


def _tabulate(one: Budget) -> Iterator[str]:
    """Write the table of one output, the largest cause first, and what it requires."""
    shown = table_points(one.frequency)
    columns = {"cause": "", f"RMS\n{one.unit}": ".3e", f"RMS velocity\n{one.unit}/s": ".3e"}
    heads = [f"{at:.4g} Hz\n{one.unit}/sqrt(Hz)" for at in one.frequency[shown]]
    causes = zip(
        ("all", *one.cause),
        (one.rms[0], *one.mean_square[0] ** 0.5),
        (one.rms_velocity[0], *one.mean_square_velocity[0] ** 0.5),
        (one.amplitude, *one.contribution.T),
        strict=True,
    )
    rows, none = [], []
    for name, *sizes, density in sorted(causes, key=lambda cause: -cause[3].max()):
        if density.any():
            sizes = ["infinite" if math.isinf(size) else size for size in sizes]
            rows.append((name, *sizes, *density[shown]))
        else:
            none.append(name)
    before = len(columns)
    yield tables.render(
        columns | dict.fromkeys(heads[:ABREAST], ".3e"), [row[: before + ABREAST] for row in rows]
    )
    for start in range(ABREAST, len(heads), ABREAST):
        some = heads[start : start + ABREAST]
        own = [(row[0], *row[before + start :][: len(some)]) for row in rows]
        yield ""
        yield tables.render({"cause": ""} | dict.fromkeys(some, ".3e"), own)
    if none:
        yield f"  no contribution of {', '.join(none)}"
    if one.requirement is not None:
        yield f"  {_describe_requirement(one.requirement)}"


def _describe_requirement(found: Requirement) -> str:
    """Describe in one line whether a requirement is met, with its margin."""
    spans = [
        f"{low:.4g} Hz" if low == high else f"{low:.4g} to {high:.4g} Hz"
        for low, high in found.exceeded
    ]
    more = f" and {len(spans) - 3} more" if len(spans) > 3 else ""
    above = f"; above it at {', '.join(spans[:3])}{more}" if spans else ""
    return f"requirement {escape_unprintable(Path(found.name).name)}: {found.outcome}{above}"


def _describe_ground(one: Budget) -> str:
    """Describe the motion of the support, and where it is not that of its models."""
    sources: dict[str, list[str]] = {}
    for dof, name in _sources(one).items():
        sources.setdefault(name, []).append(dof)
    text = "; ".join(
        f"{escape_unprintable(name)} along {', '.join(dofs)}" for name, dofs in sources.items()
    )
    if one.frequency[-1] > HIGHEST and ("nlnm" in text or "nhnm" in text):
        text += f" (known to {HIGHEST:g} Hz; above, with its acceleration at {HIGHEST:g} Hz)"
    return text or "none"


def _ground(setting: Settings, folder: Path) -> tuple[dict[str, Spectrum], Array, list[str]]:
    """Return the motions of the support, the grid within their ranges, and warnings."""
    import numpy as np

    from suspension_cli.physics import ground

    motions = ground.parse(setting["ground"], setting["isolation"], folder)
    grid = np.unique(parse_frequencies(setting["frequency"]))
    low = max((one.frequency[0] for one in motions.values()), default=0.0)
    high = min((one.frequency[-1] for one in motions.values()), default=math.inf)
    within = grid[(grid >= low) & (grid <= high)]
    if len(within) == len(grid):
        return motions, grid, []
    if not len(within):
        problem = f"has no frequency from {low:g} to {high:g} Hz, where the ground is known"
        remedy = "move it, or give a table of the ground there"
        raise InputError.of("--frequency", problem, remedy, format_value(setting["frequency"]))
    if ":" in setting["frequency"]:
        within = np.union1d(within, [end for end in (low, high) if grid[0] < end < grid[-1]])
    cause = next(
        one.name
        for one in motions.values()
        if one.frequency[0] > grid[0] or one.frequency[-1] < grid[-1]
    )
    span = f"{within[0]:.4g} to {within[-1]:.4g} Hz"
    return motions, within, [f"frequencies are cut to {span}, the range of {cause}"]


def _requirements(
    setting: Settings, outputs: Sequence[str], folder: Path, grid: Array
) -> dict[int, Spectrum]:
    """Read the required spectra by number of the output."""
    from suspension_cli.physics import ground

    result: dict[int, Spectrum] = {}
    for text in setting["requirements"]:
        name, equals, source = (part.strip() for part in text.rpartition("="))
        if equals and name not in outputs:
            remedy = f"give one of {', '.join(outputs)}, or add --output {name}"
            raise InputError.of("--requirement", "names no output", remedy, format_value(text))
        number = outputs.index(name) if equals else 0
        unit = "rad" if outputs[number].partition("@")[0].endswith(DOFS[3:]) else "m"
        path = ground.find(source, folder, "--requirement")
        with attribute_faults_to(str(path)):
            [found, *others] = ground.read(path, unit, setting["arm"]).values()
            if others:
                problem = f"has {1 + len(others)} columns of values instead of one"
                remedy = "write two columns, frequency and asd, and a file per output"
                raise InputError.of("", problem, remedy)
            first, last = found.frequency[[0, -1]]
            if first > grid[-1] or last < grid[0]:
                problem = (
                    f"is from {first:g} to {last:g} Hz, outside {grid[0]:g} to {grid[-1]:g} Hz of"
                    " the budget"
                )
                raise InputError.of("", problem, "move --frequency there")
        result[number] = found
    return result


def _model(
    run: Run, grid: Array, outputs: Sequence[str], notes: list[str]
) -> tuple[Choice, LinearSystem, bool]:
    """Choose the model; tell whether it has thermal noise. Warnings are added to `notes`."""
    from suspension_cli.linear import signals
    from suspension_cli.models import registry
    from suspension_cli.models.choice import Transfer
    from suspension_cli.physics import model_choice, thermal_noise
    from suspension_cli.physics.lossless import describe_lossless, find_lossless
    from suspension_cli.physics.missing_losses import state_missing_losses
    from suspension_cli.physics.near_limits import describe_falsified_losses

    source, wanted, arm = run.source, run.setting["fidelity"], run.setting["arm"]
    try:
        choice, model = thermal_noise.choose(source, wanted, grid, outputs, arm)
        warm = True
        lossless = find_lossless(run.design, choice.level)
        notes += [f"{run.name}: {line}" for line in describe_lossless(lossless, choice.level)]
        notes += describe_falsified_losses(run.design, choice.level)
        few = grid[decade_points(grid)]
        level = choice

        def compute(design: Design) -> tuple[Array, str]:
            return thermal_noise.amplitudes(design, level, few, outputs, arm)

        lacking = state_missing_losses(run.design, choice, compute, run.setting["tolerance"])
        choice = lacking.choice
        notes += lacking.warnings
    except InputError as error:
        warm = False

        def request(system: LinearSystem) -> Transfer:
            known = signals.bodies_with_signals(system)
            inputs = [signals.parse_input(f"{SUPPORT}.{dof}", known) for dof in "xz"]
            return Transfer(inputs, thermal_noise.parse_outputs(system, outputs, arm), grid)

        choice, model = model_choice.choose(source, wanted, request)
        why = error.faults[0].problem
        if wanted != registry.AUTO:
            why = f"the {choice.level} model does not know where along a wire its loss acts"
        notes.append(f"{run.name}: thermal noise is left out, as {why}")
    controlled = run.design.control is not None
    model = model_choice.stable_system(source, choice, controlled, run.log, model, bends=True)
    return choice, model, warm


ANALYSIS = BudgetAnalysis()
