"""`pendsus modes`: frequencies and shapes of the normal modes."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import click

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import (
    Analysis,
    Document,
    Result,
    Run,
    Settings,
)
from suspension_cli.analyses.options import MOST_WIRE_MODES, option
from suspension_cli.errors import Fault, InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from suspension_cli.design.schema import Design
    from suspension_cli.linear.eigenmodes import Modes
    from suspension_cli.linear.system import LinearSystem
    from suspension_cli.models.registry import Choice
    from suspension_cli.scene.arrays import Array

HIGHEST = 1000.0
"""Hz, up to which the violin model lists modes."""


class ModesAnalysis(Analysis):
    """Compute the normal modes: frequencies, shapes, Q.

    Prints a table (or JSON), writes DIR/NAME-modes.h5 and .png for each DESIGN. An unstable
    equilibrium is reported with its growth rates; a rigid mode (a body free to spin on one wire)
    has frequency 0; an overdamped mode has a decay rate and no frequency.

    The modes of bodies are listed. With --max-frequency (or --fidelity violin, then up to 1 kHz)
    the wires have mass, and violin modes are listed, too. The beam and violin models also give the
    dilution factor of a mode: its energy over the energy in lossy parts.

    Modes that cannot be damped from the top mass are marked with the reason. --damping sets another
    body or band of frequencies; towers on legs are judged only if it is given.

    With --animate modes are also drawn in motion: DIR/NAME-modes-3.gif is one period of mode 3.

    Examples: pendsus modes my.toml --max-frequency 500, pendsus modes my.toml --animate 3

    Returns
    -------
    Result
        With the attributes of `linear.eigenmodes.Modes`: `frequency` (m,) in Hz, `q` (m,), `label`,
        `shape`, ...

    Raises
    ------
    InputError
        If the design does not balance, or the model is not valid for it.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.modes(sus.example("husman2000/table1-case3"), fidelity="string")
    >>> found.label[0], round(float(found.frequency[0]), 4)
    ('test transverse', 0.7914)
    """

    name = "modes"
    result_type = "linear.eigenmodes.Modes"
    arguments = (options.DESIGNS,)
    parameters = (
        option(
            "--max-frequency",
            type=click.FloatRange(1e-6, 1e6),
            metavar="HZ",
            help="Highest frequency of the modes listed; auto and violin include violin modes.",
        ),
        option(
            "--all",
            "every",
            is_flag=True,
            help=(
                "Compute all modes of wires with mass, even if there are more than"
                f" {MOST_WIRE_MODES}."
            ),
        ),
        option(
            "--damping",
            metavar="band=GRID,at=STAGE",
            help=(
                "Frequencies (Hz) and stage at which modes can be damped, or none."
                "  [default: band=0.5:5,at=top; of towers on legs none]"
            ),
        ),
        option(
            "--animate",
            metavar="MODES",
            help=(
                "Write moving pictures (GIF) of modes: numbers or labels, separated by commas, or"
                " all."
            ),
            group=options.FILES,
        ),
        options.ACCURACY,
        *options.WRITING,
    )

    def solve(self, run: Run) -> Result:
        """Compute the modes of one design."""
        import numpy as np

        from suspension_cli.physics import growth, model_choice, near_limits
        from suspension_cli.physics.lossless import describe_lossless, find_lossless

        choice, model, undamped, modes = _solve(run)
        model_choice.describe_equilibrium(run.source, choice, model, run.log)
        modes = dataclasses.replace(modes, **_damping(run.design, run.setting["damping"]))
        _animated(modes, run.setting)  # refuse unknown modes before anything is written
        lossless = find_lossless(run.design, choice.level)
        near_limits.warn(run.design, undamped, run.log)
        if np.isfinite(modes.q).any():
            for line in describe_lossless(lossless, choice.level):
                run.log.warn(f"{run.name}: {line}")
            choice, lines = _state_losses(run, choice)
            for line in lines:
                run.log.warn(line)
        if not modes.stable:
            grows = growth.find_growth(run.design, choice.model, model)
            remedy = "" if grows is None else f"; {grows.cause.remedy}"
            for n in np.flatnonzero(modes.growth_rate):
                run.log.warn(f"{run.name} is unstable: {growth.describe(modes, int(n))}{remedy}")
        extra = {"without_loss": [part.part for part in lossless]}
        return Result(self, run.source, choice, modes, extra, command=run.command)

    def document(self, result: Result) -> Document:
        """Return the modes, ascending."""
        import numpy as np

        modes: Modes = result.data
        rows, labels, verdicts, growth = [], modes.label, modes.verdict, modes.growth_rate
        for n, (body, dof) in enumerate(modes.home):
            row: Document = {"frequency_hz": modes.frequency[n], "dof": dof}
            row |= {"stage": body, "q": modes.q[n]}
            if np.isfinite(modes.dilution[n]):
                row["dilution"] = float(modes.dilution[n])
            if growth[n] > 0:
                row["growth_rate_per_s"] = float(growth[n])
            if modes.overdamped[n]:
                row["decay_rate_per_s"] = float(modes.decay_rate[n])
            row["label"], row["fraction"] = labels[n], float(modes.fractions[n].max())
            row["top_mass_fraction"] = float(modes.top_fraction[n])
            row["verdict"] = verdicts[n] or None
            rows.append(row)
        band, at = modes.damping_band or None, modes.damping_at
        damping = band and {"band_hz": [*band], "at": at}
        return {"stable": modes.stable, "modes": rows, "damping": damping} | result.extra

    def text(self, result: Result) -> str:
        """Return a table of the modes."""
        import numpy as np

        from suspension_cli.linear.eigenmodes import TOP

        modes: Modes = result.data
        names = modes.numbered_label
        verdicts = modes.verdict
        groups = modes.groups
        first = [group[0] for group in groups]
        fraction = modes.damping_fraction
        columns: dict[str, tuple[str, Sequence[float | str | None]]] = {
            "#": ("d", [n + 1 for n in first]),
            "frequency\nHz": ("#.5g", [_frequency(modes, n) for n in first]),
        }
        if np.isfinite(modes.q).any():
            columns["Q"] = ".4g", [modes.q[n] if modes.q[n] > 0 else None for n in first]
        if np.isfinite(modes.dilution).any():
            columns["dilution"] = ".4g", [modes.dilution[n] for n in first]
        damper = "the top mass" if modes.damping_at in (None, TOP) else modes.damping_at
        column = f"{damper.removeprefix('the ')}\n%"
        columns[column] = ".1f", ["" if modes.order[n] else 100 * fraction[n] for n in first]
        what = [_describe(modes, group, names, verdicts) for group in groups]
        failing = f"; why damping at {damper} fails" * any(";" in text for text in what)
        columns[f"mode, by fraction of kinetic energy{failing}"] = "", what
        forms = {head: form for head, (form, _) in columns.items()}
        rows = zip(*(values for _, values in columns.values()), strict=True)
        title = result.given.title + (
            f"  [{result.given.name}]" if result.given.title != result.given.name else ""
        )
        return "\n".join([title, result.choice.line, "", tables.render(forms, [*rows])])

    def figures(self, result: Result, setting: Settings) -> dict[str, Figure]:
        """Draw every mode, and where wires have mass the Q of all."""
        from suspension_cli.analyses.modes import picture
        from suspension_cli.equilibrium.nominal import expand
        from suspension_cli.linear.damped import LIGHT_ENDING

        modes, design = result.data, result.given.design
        pages = picture.draw_pages(modes, design, expand(design), result.subtitle)
        figures = {f"-{n}" if n > 1 else "": page.figure for n, page in enumerate(pages, 1)}
        if not all(name.endswith(LIGHT_ENDING) for name in modes.wire):
            figures["-wires"] = picture.draw_quality(modes, design, result.subtitle)
        return figures

    def animations(self, result: Result, setting: Settings) -> Iterator[tuple[str, bytes]]:
        """Draw one period of every mode of --animate."""
        chosen = _animated(result.data, setting)
        if chosen:
            from suspension_cli.analyses.modes import picture
            from suspension_cli.equilibrium.nominal import expand

            scene = expand(result.given.design)
            for n in chosen:
                yield f"-{n + 1}.gif", picture.animate(result.data, n, result.given.design, scene)


def _animated(modes: Modes, setting: Settings) -> list[int]:
    """Return the modes (from 0) that --animate names."""
    if not setting.get("animate"):
        return []
    from suspension_cli.analyses.modes import picture

    return picture.parse_names(modes, setting["animate"])


def _damping(design: Design, text: str | None) -> Settings:
    """Parse --damping into `damping_band` and `damping_at` of `Modes`."""
    from suspension_cli.design.faults import suggest
    from suspension_cli.grids import parse_band
    from suspension_cli.linear.eigenmodes import DAMPING_BAND, TOP

    on_legs = any(stage.inverted_pendulum for stage in design.stage)
    if (text is None and on_legs) or text == "none":
        return {"damping_band": ()}
    found: Settings = {"damping_band": DAMPING_BAND, "damping_at": TOP}
    known = [TOP, *(stage.name for stage in design.stage)]
    for item in re.split(r",(?=[a-z]+=)", text or f"at={TOP}"):
        key, _, value = item.partition("=")
        if key == "band":
            ends = value.replace(",", ":")
            found["damping_band"] = parse_band(ends, "--damping", with_zero=True, before="band=")
        elif key != "at":
            remedy = "give for example band=0.5:5,at=top, or none"
            raise InputError([Fault("--damping", "is no band, stage, or none", remedy, item)])
        elif value not in known:
            raise InputError([Fault("--damping", "is no stage", suggest(value, known), value)])
        else:
            found["damping_at"] = value
    return found


def _solve(run: Run) -> tuple[Choice, LinearSystem, Modes, Modes]:
    """The choice of model, its system, the modes without damping, and with all losses.

    If modes of wires are listed too, both are the modes with all losses.
    """
    import numpy as np

    from suspension_cli.linear import eigenmodes
    from suspension_cli.models import registry
    from suspension_cli.models.choice import percent, shifts
    from suspension_cli.physics import model_choice, wire_modes

    highest, level, tolerance = (run.setting[n] for n in ("max_frequency", "fidelity", "tolerance"))
    auto = level == registry.AUTO
    wanted = registry.VIOLIN.name if auto and highest is not None else level
    choice, model = model_choice.for_modes(run.source, wanted, tolerance)
    if choice.model.has_wire_mass and not (auto and highest is None):
        top, cause = highest or HIGHEST, "--max-frequency" if highest else "by default"
        choice = registry.Choice(choice.level, f"all modes up to {top:g} Hz", 0.0)
        _admit(run, wire_modes.count_modes(model, top), top, cause)
        with run.log.progress() as bar:
            listed = wire_modes.solve(model, top, damping=True, progress=bar)
        return choice, model, listed, listed

    def admit(number: int, top: float) -> None:
        _admit(run, number, top, "that of the highest mode")

    try:
        with run.log.progress() as bar:
            listed = wire_modes.solve_bodies(model, admit, bar)
    except TooManyModes as many:
        if not auto:
            raise
        why = f"{many.faults[0].problem}, so wire mass is neglected (--all includes it)"
        run.log.say(f"{run.name}: {why}")
        heavy, (choice, model) = (
            model,
            model_choice.for_modes(run.source, level, tolerance, massless=True),
        )
        shift = percent(float(np.median(shifts(model, heavy)[1])))
        worst = f"{percent(choice.error)} in {choice.what}, {shift} in the median mode"
        why = f"wire mass, {worst}, as its modes would take minutes"
        choice = dataclasses.replace(choice, reason=f"as --all is not given; neglected: {why}")
        listed = wire_modes.solve_bodies(model)
    if highest is not None:
        listed = listed.up_to(highest)
        if not len(listed.q):
            raise wire_modes.no_mode_error(highest)
    return choice, model, eigenmodes.solve(model), listed


def _state_losses(run: Run, choice: Choice) -> tuple[Choice, list[str]]:
    """Add losses that materials lack to what is neglected; also list what makes Q wrong."""
    import numpy as np

    from suspension_cli.linear import eigenmodes
    from suspension_cli.physics.missing_losses import state_missing_losses
    from suspension_cli.physics.near_limits import describe_falsified_losses

    lines = describe_falsified_losses(run.design, choice.level)
    if not choice.model.bends_wires:
        return choice, lines

    def compute(design: Design) -> tuple[Array, str]:
        q = eigenmodes.solve(choice.model.system(design)).q
        return np.where(np.isfinite(q) & (q > 0), q, 1.0), "the Q of a mode"

    lacking = state_missing_losses(run.design, choice, compute, run.setting["tolerance"])
    # the stated error is that of frequencies
    return dataclasses.replace(lacking.choice, error=choice.error), lines + lacking.warnings


class TooManyModes(InputError):
    """Wires with mass have so many modes that all would take minutes."""


def _admit(run: Run, number: int, top: float, cause: str) -> None:
    """Refuse more than `MOST_WIRE_MODES` without --all, with what may be implausible."""
    from suspension_cli.physics import near_limits

    if number <= MOST_WIRE_MODES or run.setting["every"]:
        return
    problem = (
        f"wires with mass have {number:,} modes up to {top:.4g} Hz ({cause}); more than"
        f" {MOST_WIRE_MODES:,} take minutes"
    )
    remedy = (
        "check lengths and radii of wires (m), give a lower --max-frequency, or --all to compute"
        " all"
    )
    causes = [item.line("") for item in near_limits.find_serious(run.design)]
    if causes and not causes[0].startswith("control."):
        remedy = f"probable cause: {causes[0]}"
    raise TooManyModes([Fault("", problem, remedy)])


def _describe(
    modes: Modes, group: Sequence[int], names: Sequence[str], verdicts: Sequence[str]
) -> str:
    """Name a mode by the motions with most kinetic energy, or wire modes of nearly one frequency.

    After ";" follows why it cannot be damped, or how it grows or decays.
    """
    import numpy as np

    from suspension_cli.linear.eigenmodes import describe
    from suspension_cli.physics import growth

    n, fractions = group[0], modes.fractions[group[0]]
    if modes.order[n]:
        (body, dof), labels = modes.home[n], {modes.label[k] for k in group}
        kind = "violin" if dof.startswith("violin") else dof
        text = labels.pop() if len(labels) == 1 else f"{body} {kind} {modes.order[n]}"
        last = modes.frequency[group[-1]]
        return text + (f", {len(group)} modes to {last:#.6g} Hz" if len(group) > 1 else "")
    lead = modes.place.index(".".join(modes.home[n]))
    order = np.argsort(-fractions.round(9), kind="stable")
    order = [lead, *order[order != lead]][:3]
    text = ", ".join(
        f"{describe(modes.place[i]) if k else names[n]} {100 * fractions[i]:.0f} %"
        for k, i in enumerate(order)
        if fractions[i] > 0.02
    )
    if modes.growth_rate[n] > 0:
        text += f"; {growth.describe(modes, n).removeprefix(modes.label[n] + ' ')}"
    elif modes.overdamped[n]:
        text += f"; decays at {modes.decay_rate[n]:#.4g} 1/s"
    elif modes.omega_squared[n] > 0 and verdicts[n] not in ("", "can be damped"):
        text += f"; {verdicts[n]}"
    return text


def _frequency(modes: Modes, n: int) -> float | str:
    if modes.growth_rate[n] > 0:
        return "unstable"
    if modes.omega_squared[n] == 0:
        return "overdamped" if modes.overdamped[n] else "rigid"
    return modes.frequency[n]


ANALYSIS = ModesAnalysis()
