"""`pendsus budget`: motion of the mirror by cause, from the ground on."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import Analysis, Run, Settings, name_mirrors
from suspension_cli.analyses.options import option
from suspension_cli.errors import escape_unprintable
from suspension_cli.grids import table_points

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from suspension_cli.analyses.budget.solve import Budget
    from suspension_cli.physics.noise_budget import MotionBudget, Requirement

GROUND = "nhnm"
"""Ground of a noisy site: a requirement that is met there is met anywhere."""
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
    Budget
        With `frequency` (f,) in Hz, `amplitude` (f, outputs) in m/sqrt(Hz) or rad/sqrt(Hz),
        `contribution` (f, outputs, causes), `rms` and `rms_velocity` (f, outputs) above each
        frequency; `motions` has an item per output, with `parts` by cause and `requirement`.

    Raises
    ------
    InputError
        If the closed loop is unstable, or a table has faults.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.budget(sus.example("double"), frequency=[1.0, 10.0], ground=["nlnm"])
    >>> found.cause
    ('ground.x', 'ground.y', 'ground.z', 'thermal')
    """

    name = "budget"
    result_type = "analyses.budget.solve.Budget"
    draws_neglected = True
    arguments = (options.DESIGN,)
    parameters = (
        options.signals("output", options.MOTIONS, "x, pitch and yaw of the mirror"),
        option(
            "--ground",
            multiple=True,
            default=(GROUND,),
            metavar="[COORDINATES=]SOURCE",
            help="Motion of the support: nlnm (quiet ground), nhnm (noisy ground), vc-e (quiet"
            " laboratory) to vc-a (noisy one), kamioka-quiet, kamioka-noisy, aligo-isi (or"
            " aligo-bsc) and aligo-ham (platforms), a file, or none; x,y=SOURCE for some"
            " coordinates (repeatable).",
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
        option(
            "--by",
            type=click.Choice(["part", "stage"]),
            default="part",
            help="Lines of the table and the picture: each sensor and actuator, with equal OSEMs"
            " together, or all sensors, and all actuators, of a stage.",
        ),
        options.frequencies("0.01:100:2000"),
        *options.BEAM,
        options.ACCURACY,
        *options.WRITING,
    )

    def solve(self, run: Run) -> Budget:
        """Compute the budget of every output."""
        from suspension_cli.analyses.budget import solve

        return solve.solve(self, run)

    def text(self, result: Budget) -> str:
        """Return a table per output: RMS and amplitude spectral densities by cause."""
        from suspension_cli.analyses.budget import cause_groups

        first = result.first
        ends = dict.fromkeys(first.frequency[[0, -1]].tolist())
        span = f"{' to '.join(tables.write_given([*ends]))} Hz"
        lines = [result.run.choice.line, f"ground: {_describe_ground(first)}"]
        for n, one in enumerate(result.motions):
            tilt = 0.0 if result.tilt is None else float(result.tilt[n])
            title = f"{one.output}{name_mirrors(result.mirrors, tilt)}, {span}"
            grouped = cause_groups.group(one, result.run.design.design, result.by)
            lines += ["", title, *_tabulate(grouped.budget)]
            lines += [f"  {remark}" for remark in grouped.remarks]
        if result.drive is not None:
            units = ("N", "A", "V", "counts", "of range")
            columns = {"coil": ""} | {f"RMS\n{unit}": ".3g" for unit in units}
            rows = [[*vars(one).values()] for one in result.drive]
            lines += ["", f"Drives of coils by the loops, {span}"]
            lines.append(tables.render(columns | {"mostly due to": ""}, rows))
        return "\n".join(lines)

    def figures(self, result: Budget, setting: Settings) -> dict[str, Figure]:
        """Draw a panel per output."""
        from suspension_cli.analyses.budget import cause_groups, picture

        title = result.subtitle + name_mirrors(result.mirrors)
        design = result.run.design.design
        shown = [cause_groups.group(one, design, result.by) for one in result.motions]
        return {"": picture.draw(shown, title)}


def _tabulate(one: MotionBudget) -> Iterator[str]:
    """Write the table of one output, the largest cause first, and what it requires."""
    shown = table_points(one.frequency)
    columns = {"cause": "", f"RMS\n{one.unit}": ".3e", f"RMS velocity\n{one.unit}/s": ".3e"}
    frequencies = tables.write_given(one.frequency[shown].tolist())
    heads = [f"{at} Hz\n{one.unit}/sqrt(Hz)" for at in frequencies]
    causes = zip(
        ("all", *one.cause),
        (one.total_rms, *one.rms_by_cause.values()),
        (one.total_rms_velocity, *one.rms_velocity_by_cause.values()),
        (one.amplitude, *one.contribution.T),
        strict=True,
    )
    rows = []
    none = []
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


def _describe_ground(one: MotionBudget) -> str:
    """Describe the motion of the support, and where it is not that of its models."""
    sources: dict[str, list[str]] = {}
    for dof, name in one.ground.items():
        sources.setdefault(name, []).append(dof)
    text = "; ".join(
        f"{escape_unprintable(name)} along {', '.join(dofs)}" for name, dofs in sources.items()
    )
    if one.frequency[-1] > HIGHEST and ("nlnm" in text or "nhnm" in text):
        text += f" (known to {HIGHEST:g} Hz; above, with its acceleration at {HIGHEST:g} Hz)"
    return text or "none"


ANALYSIS = BudgetAnalysis()
