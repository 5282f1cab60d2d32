"""`pendsus modes`: frequencies and shapes of the normal modes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import click

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import Analysis, Document, Run, Settings
from suspension_cli.analyses.options import MOST_WIRE_MODES, option

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from suspension_cli.analyses.modes.solve import Modes
    from suspension_cli.linear import eigenmodes


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
    Modes
        With `frequency` (m,) in Hz, `q` (m,), `label`, `shape`, ...

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
    result_type = "analyses.modes.solve.Modes"
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
                f" {MOST_WIRE_MODES} (fewer of tall towers), which takes minutes."
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

    def solve(self, run: Run) -> Modes:
        """Compute the modes of one design."""
        from suspension_cli.analyses.modes import solve

        found = solve.solve(self, run, MOST_WIRE_MODES)
        _animated(found, run.setting)  # refuse unknown modes before anything is written
        return found

    def document(self, result: Modes) -> Document:
        """Add where modes move most and can be damped; overdamped ones alone have a decay rate."""
        band = result.damping_band or None
        damping = band and {"band_hz": [*band], "at": result.damping_at}
        document: Document = super().document(result)
        columns = (document["modes"], result.home, result.fractions, result.overdamped)
        for row, (body, dof), fractions, overdamped in zip(*columns, strict=True):
            row |= {"stage": body, "dof": dof, "fraction": fractions.max()}
            row["verdict"] = row["verdict"] or None
            if not overdamped:
                row.pop("decay_rate_per_s", None)
        return document | {"damping": damping}

    def text(self, result: Modes) -> str:
        """Return a table of the modes."""
        import numpy as np

        from suspension_cli.linear.eigenmodes import TOP

        verdicts = result.verdict
        groups = result.groups
        first = [group[0] for group in groups]
        fraction = result.damping_fraction
        columns: dict[str, tuple[str, Sequence[float | str | None]]] = {
            "#": ("d", [n + 1 for n in first]),
            "frequency\nHz": ("#.5g", [_frequency(result, n) for n in first]),
        }
        if np.isfinite(result.q).any():
            columns["Q"] = ".4g", [result.q[n] if result.q[n] > 0 else None for n in first]
        if np.isfinite(result.dilution).any():
            columns["dilution"] = ".4g", [result.dilution[n] for n in first]
        damper = "the top mass" if result.damping_at in (None, TOP) else result.damping_at
        column = f"{damper.removeprefix('the ')}\n%"
        columns[column] = ".1f", ["" if result.order[n] else 100 * fraction[n] for n in first]
        what = [_describe(result, group, verdicts) for group in groups]
        failing = f"; why it cannot be damped at {damper}" * any(";" in text for text in what)
        columns[f"mode, by fraction of kinetic energy{failing}"] = "", what
        forms = {head: form for head, (form, _) in columns.items()}
        rows = zip(*(values for _, values in columns.values()), strict=True)
        run = result.run
        title = f"{run.title}  [{run.name}]" if run.title != run.name else run.title
        return "\n".join([title, run.choice.line, "", tables.render(forms, [*rows])])

    def figures(self, result: Modes, setting: Settings) -> dict[str, Figure]:
        """Draw every mode, and where wires have mass the Q of all."""
        from suspension_cli.analyses.modes import picture
        from suspension_cli.equilibrium.nominal import expand_geometry
        from suspension_cli.linear.terms import LIGHT_ENDING

        design = result.run.design.design
        pages = picture.draw_pages(result, design, expand_geometry(design), result.subtitle)
        figures = {f"-{n}" if n > 1 else "": page.figure for n, page in enumerate(pages, 1)}
        if not all(name.endswith(LIGHT_ENDING) for name in result.wire):
            figures["-wires"] = picture.draw_quality(result, design, result.subtitle)
        return figures

    def animations(self, result: Modes, setting: Settings) -> Iterator[tuple[str, bytes]]:
        """Draw one period of every mode of --animate."""
        chosen = _animated(result, setting)
        if chosen:
            from suspension_cli.analyses.modes import picture
            from suspension_cli.equilibrium.nominal import expand_geometry

            design = result.run.design.design
            scene = expand_geometry(design)
            for n in chosen:
                yield f"-{n + 1}.gif", picture.animate(result, n, design, scene)


def _animated(modes: Modes, setting: Settings) -> list[int]:
    """Return the modes (from 0) that --animate names."""
    if not setting.get("animate"):
        return []
    from suspension_cli.analyses.modes import picture

    return picture.parse_names(modes, setting["animate"])


def _describe(modes: eigenmodes.Modes, group: Sequence[int], verdicts: Sequence[str]) -> str:
    """Name a mode by the motions with most kinetic energy, or wire modes of nearly one frequency.

    After ";" follows why it cannot be damped, or how it grows or decays.
    """
    import numpy as np

    from suspension_cli.linear.eigenmodes import describe
    from suspension_cli.physics import growth

    n = group[0]
    fractions = modes.fractions[group[0]]
    if modes.order[n]:
        body, dof = modes.home[n]
        labels = {modes.motion[k] for k in group}
        kind = "violin" if dof.startswith("violin") else dof
        text = labels.pop() if len(labels) == 1 else f"{body} {kind} {modes.order[n]}"
        last = modes.frequency[group[-1]]
        return text + (f", {len(group)} modes to {last:#.6g} Hz" if len(group) > 1 else "")
    lead = modes.place.index(".".join(modes.home[n]))
    order = np.argsort(-fractions.round(9), kind="stable")
    order = [lead, *order[order != lead]][:3]
    text = ", ".join(
        f"{describe(modes.place[i]) if k else modes.label[n]} {100 * fractions[i]:.0f} %"
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


def _frequency(modes: eigenmodes.Modes, n: int) -> float | str:
    if modes.growth_rate[n] > 0:
        return "unstable"
    if modes.omega_squared[n] == 0:
        return "overdamped" if modes.overdamped[n] else "rigid"
    return modes.frequency[n]


ANALYSIS = ModesAnalysis()
