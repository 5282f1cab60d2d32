"""`pendsus optimise`: numbers of a design that meet goals."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import (
    Analysis,
    Document,
    Log,
    Run,
    Settings,
)
from suspension_cli.analyses.options import argument, option

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from suspension_cli.analyses.optimise.optimum import Found, Optimum

TABLES = ("requirement", "objective", "goal", "free", "equal")
"""Of a file of goals."""
EXAMPLE = """It is a TOML file of goals and free numbers; make one with these lines:

cat > goals.toml << END
requirement = [{ quantity = "lowest pitch", at_least = 0.5 }]
free = [{ name = "stage.test.wires.d", lower = 1e-3, upper = 5e-3 }]
END

and run: pendsus optimise DESIGN goals.toml"""
ROUNDING = 0.1
"""Part of the tolerance by which the rounding of numbers may change a quantity."""
BOUNDS = ("lower", "", "upper")
STARTS = {"file": "the numbers of the file", "random": "random numbers"}
"""Starts of searches by origin, in words; that by velocity damping is named in full."""
NEAREST = 3
"""Printed limits of a goal that is met: those with the least margin."""


class OptimiseAnalysis(Analysis):
    """Choose numbers of a design so that it meets goals.

    GOALS is a TOML file that lists goals, and the free numbers with bounds. Writes the design as
    DIR/NAME-optimised.toml, and DIR/NAME-optimise.h5 and .png. The written design is checked
    against every goal as by modes, response and check. The exit code is 1 if a limit is not met.

    Example: pendsus optimise my.toml goals.toml

    Returns
    -------
    Optimum
        With `design`, the one that was found (`run.design` is that from which the search started),
        `met`, and the tables `numbers`, `limits`, `quantities`, `modes` and `starts`.

    Raises
    ------
    InputError
        With the faults of `goals` or of the design.

    Examples
    --------
    >>> from pathlib import Path
    >>> import suspension_cli as sus
    >>> written = Path("goals.toml").write_text('''
    ... goal = [{ kind = "band", dof = ["yaw"], at_least = 2.0 }]
    ... free = [{ name = "stage.test.wires.t2", lower = 0.01, upper = 0.2 }]
    ... ''')
    >>> found = sus.optimise(sus.template("single"), "goals.toml", starts=1)
    >>> found.met, found.numbers.after.round(3)
    (True, array([0.136]))
    """

    name = "optimise"
    result_type = "analyses.optimise.optimum.Optimum"
    draws_neglected = True
    arguments = (options.DESIGN, argument("goals", metavar="GOALS", example=EXAMPLE))
    inputs = (
        options.Input(),
        options.Input(
            "goals", "PathLike", "TOML file of goals, and of the free numbers with bounds."
        ),
    )
    parameters = (
        option(
            "--starts",
            type=click.IntRange(1, 64),
            default=6,
            help=(
                "Number of designs from which searches start; the first is the design itself. If it"
                " misses goals of loops, velocity damping is one more."
            ),
        ),
        option(
            "--seed",
            type=click.IntRange(0),
            default=1,
            help="Seed of the random starts.",
        ),
        options.ACCURACY,
        *options.WRITING,
    )

    def read(self, ask: Callable[..., Run], files: Settings) -> Run:
        """Read the design and the goals."""
        from suspension_cli.design import goals, reader

        run = ask(files["design"])
        file = files["goals"]
        text = reader.read_text(file)
        inputs = {"file": file, "text": text, "goals": goals.read(file, text)}
        return replace(run, inputs=inputs)

    def solve(self, run: Run) -> Optimum:
        """Search for a design, and check it."""
        from suspension_cli.analyses.optimise import solve as optimise
        from suspension_cli.analyses.optimise.optimum import Optimum
        from suspension_cli.errors import InputError
        from suspension_cli.models.registry import Choice

        setting = run.setting
        file = run.inputs["file"]
        how = {name: setting[name] for name in ("starts", "seed", "tolerance")}
        how |= {"level": setting["fidelity"], "rounding": ROUNDING, "log": run.log}
        with run.log.progress() as bar:
            try:
                found = optimise.solve(run.source, run.inputs["goals"], report=bar, **how)
            except InputError as error:
                if error.file:
                    raise
                of_goals = error.faults[0].key.split(".")[0] in TABLES
                raise error.in_file(file if of_goals else run.source.file) from None
        choice = Choice(found.fidelity, found.reason, found.error)
        run.log.detail(f"search and check of {run.name}: {choice.line}")
        _warn(found, run.log)
        found = replace(found, goals=run.inputs["text"])
        return Optimum.extending(found, goals_file=str(file), run=run.origin(self, choice))

    def document(self, result: Optimum) -> Document:
        """Name the bound that a number is at."""
        document = super().document(result)
        for row in document["parameters"]:
            row["at_bound"] = BOUNDS[row["at_bound"] + 1] or None
        return document

    def text(self, result: Optimum) -> str:
        """Return parameters, goals with their limits, and the ends of the searches."""
        numbers = result.numbers
        remarks = (
            f"{'dependent ' * bool(tied)}{f'at its {BOUNDS[bound + 1]} bound' * bool(bound)}"
            for tied, bound in zip(numbers.tied, numbers.bound, strict=True)
        )
        columns = {"parameter": "", "unit": "", "before": "#.6g", "after": "#.6g", "": ""}
        rows = zip(numbers.name, numbers.unit, numbers.before, numbers.after, remarks, strict=True)
        lines = [result.run.choice.line, "", tables.render(columns, rows), ""]
        columns = {"goal": "", "before": ".4g", "after": ".4g", "margin\n%": "+.3g", "": ""}
        columns |= {"limit": "", "model": ""} if len(result.levels) > 1 else {"limit": ""}
        lines += [tables.render(columns, [row[: len(columns)] for row in _goals(result)])]
        lines += [f"  UNKNOWN  {what}" for what in result.unknown]
        return "\n".join([*lines, "", *_verdict(result)])

    def figures(self, result: Optimum, setting: Settings) -> dict[str, Figure]:
        """Draw modes and limits before and after."""
        from suspension_cli.analyses.optimise import picture

        return {"": picture.draw(result, result.subtitle)}

    def others(self, result: Optimum, path: Path) -> list[Path]:
        """Write the optimised design as NAME-optimised.toml, with its origin and the text."""
        from suspension_cli.design.toml_edits import headed
        from suspension_cli.files.whole_files import write_bytes
        from suspension_cli.version import __version__

        start = result.run.design
        made = path.with_name(f"{start.stem()}-optimised.toml")
        goals = Path(result.goals_file).name or "goals"
        head = f"{Path(start.file).name}, optimised for {goals} by pendsus {__version__}:"
        lines = [head, f"  {result.run.command}", *str(result).splitlines()]
        write_bytes(made, headed(lines, result.toml).encode())
        return [made]

    def exit_code(self, result: Optimum) -> int:
        """Return 1 if a limit is not met."""
        return 0 if result.met else 1


def _warn(found: Found, log: Log) -> None:
    """Warn of couplings that are 0, and of an unstable design."""
    from suspension_cli.design import reader
    from suspension_cli.physics import near_limits

    near_limits.warn_implausible(reader.parse(found.toml), log)
    for name, value in zip(found.quantities.name, found.quantities.after, strict=True):
        if value == 0:
            problem = "is 0 by the symmetry of the design, whatever its numbers are"
            remedy = (
                "give its requirement in the file of goals, with a perturbation, or take the yield"
                " of imperfect builds (pendsus tolerance)"
            )
            log.warn(f"{name} {problem}; {remedy}")
    modes = zip(found.modes.label, found.modes.after, strict=True)
    if unstable := ", ".join(label for label, after in modes if math.isnan(after)):
        remedy = "require their frequencies"
        log.warn(f"the design found is unstable: {unstable}; {remedy}")


def _goals(found: Optimum) -> Iterator[list[float | str | None]]:
    """Rows for goals of one name: limits not met, active, or with the least margin; objectives.

    The last column is the model in which each is computed.
    """
    limits = found.limits
    each = found.quantities
    names = limits.group
    for name in dict.fromkeys(names):
        mine = [n for n, own in enumerate(names) if own == name]
        mine.sort(key=lambda n: (math.isfinite(limits.margin[n]), limits.margin[n]))
        mine.sort(key=lambda n: bool(limits.met[n] and not limits.active[n]))
        shown = max(sum(not limits.met[n] or limits.active[n] for n in mine), NEAREST)
        title = f"{name}, {shown} of {len(mine)} limits" if len(mine) > shown else name
        for n in mine[:shown]:
            before = float(limits.before[n])
            after = float(limits.value[n])
            margin = round(100 * float(limits.room[n]), 4) + 0.0  # -0.0 becomes 0.0
            remark = "" if limits.met[n] else "NOT MET"
            remark = "active" if limits.met[n] and limits.active[n] else remark
            title = title if n == mine[0] else ""
            model = each.model[limits.quantity[n]]
            yield [title, before, after, margin, remark, limits.name[n], model]
    rows = zip(each.name, each.unit, each.before, each.after, each.weight, each.model, strict=True)
    for name, unit, before, after, weight, model in rows:
        if weight:
            title = "minimised" if weight > 0 else "maximised"
            named = name if unit == "1" else f"{name}, {unit}"
            yield [title, before, after, None, "", named, model]


def _verdict(found: Optimum) -> Iterator[str]:
    """Say how many limits are met, what prevents the others, and where the searches ended."""
    limits = found.limits
    numbers = found.numbers
    starts = found.starts
    count = len(limits.name)
    missed = int((~limits.met).sum())
    said = [f"{count or 'no'} limit{'' if count == 1 else 's'}"]
    if missed:
        said.append(f"{missed} NOT MET")
    elif count:
        said.append("met" if count == 1 else "all are met")
    if found.unknown:
        said.append(f"{len(found.unknown)} NOT KNOWN")
    yield ", ".join([*said, found.checked])
    yield from found.remarks
    if found.digits:
        yield (
            f"numbers are rounded to {found.digits} digits, which changes no quantity of the goals"
            f" by more than {100 * found.rounding:.2g} %"
        )
    held = [name for name, by in zip(limits.name, limits.multiplier, strict=True) if by]
    rows = zip(numbers.name, numbers.bound, numbers.multiplier, strict=True)
    held += [f"the {BOUNDS[at + 1]} bound of {name}" for name, at, by in rows if at and by > 0]
    if missed and held:
        yield f"what is not met is limited by {', '.join(held)}"
    if len(starts.place) > 1:
        here = int((starts.place == 1).sum())
        met = int((starts.after <= 1e-8).sum())
        others = "" if met == len(starts.place) else f"; {met} met all limits"
        yield f"{here} of {len(starts.place)} searches ended at this design{others}"
    if not set(starts.origin) <= set(STARTS):
        reached = zip(starts.origin, starts.place, strict=True)
        best = dict.fromkeys(STARTS.get(origin, origin) for origin, place in reached if place == 1)
        yield f"it was found from {', '.join(best)}"


ANALYSIS = OptimiseAnalysis()
