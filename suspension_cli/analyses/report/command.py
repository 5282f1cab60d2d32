"""`pendsus report`: one HTML file of a design with all its analyses."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from suspension_cli.analyses import options
from suspension_cli.analyses.analysis import Analysis, Document, Run, Settings
from suspension_cli.errors import InputError
from suspension_cli.files.whole_files import write_bytes

if TYPE_CHECKING:
    import h5py

    from suspension_cli.analyses.report.solve import Report


class ReportAnalysis(Analysis):
    """Write one HTML file of a design with all its analyses, which opens without network.

    It has the drawing, checks, modes, responses, couplings, noises, tolerances and damping loops,
    and the command of each: DIR/NAME-report.html. Any browser opens and prints it. Options of each
    analysis are those of the design's [analysis] tables. A section that cannot be computed says
    why.

    Example: pendsus report my.toml

    Returns
    -------
    Report
        Record with the `path` of the page, its sections, commands and verdicts on requirements.

    Raises
    ------
    InputError
        If a section or signal does not exist, the design does not balance, or the file cannot be
        written. Other errors are reported in the section concerned.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> made = sus.report(sus.example("double"), "double.html", sections="numbers")
    >>> made.path, [one.title for one in made.sections]
    (PosixPath('double.html'), ['Main numbers'])
    """

    name = "report"
    has_model = False
    arguments = (options.DESIGN,)
    inputs = (
        options.Input(),
        options.Input(
            "path",
            "PathLike",
            "Of the file. Results files of the design in its folder are used where they save time.",
        ),
    )
    returns = "analyses.report.solve.Report"
    parameters = (
        options.option(
            "--sections",
            metavar="NAME,...",
            help=(
                "Sections to include: drawing, numbers, check, modes, response, coupling, thermal,"
                " budget, tolerance, damping.  [default: all that the design has]"
            ),
        ),
        options.signals("input", "Input of the responses", "the support's x, y, z and yaw"),
        options.signals("output", "Output of the responses", "motions of the mirror"),
        options.option(
            "--builds",
            type=click.IntRange(100, 1_000_000),
            default=1000,
            help=(
                "Number of random builds, unless a results file has the tolerances of this design."
            ),
        ),
        *options.BEAM,
        options.FIDELITY,
        options.ACCURACY,
        options.OVERRIDES,
        options.TIES,
        options.OUT,
        options.NAME,
        options.QUIET,
        options.VERBOSE,
    )

    def read(self, ask: Callable[..., Run], files: Settings) -> Run:
        """Read the design, and refuse unknown sections."""
        from suspension_cli.analyses.report.sections import parse_sections

        run = ask(files["design"])
        parse_sections(run.setting["sections"])
        folder = Path(files["path"]).parent if "path" in files else run.folder
        return dataclasses.replace(run, folder=folder)

    def solve(self, run: Run) -> Report:
        """Compose the page."""
        from suspension_cli.analyses.report import solve

        return solve.solve(self, run)

    def text(self, result: Report) -> str:
        """Return how many requirements are met, and what has no results."""
        from suspension_cli.analyses import verdicts

        lines = [verdicts.summarise(result.verdicts)] if result.verdicts else []
        without = [one for one in result.sections if one.missing]
        lines += [f"{one.title}: {one.missing}" for one in without]
        return "\n".join(lines)

    def document(self, result: Report) -> Document:
        """Add the path of the page, and the verdicts as `check` gives them."""
        from suspension_cli.analyses import verdicts

        path = None if result.path is None else str(result.path)
        judged = [verdicts.document(one) for one in result.verdicts]
        return super().document(result) | {"path": path, "requirements": judged}

    def path(self, result: Report, folder: Path) -> Path:
        """Path of the page."""
        return folder / f"{result.run.design.stem()}-report.html"

    def save(self, path: Path, result: Report) -> None:
        """Write the page."""
        write_bytes(path, result.page.encode())

    def fill(self, file: h5py.File, result: Report) -> None:
        """Refuse: a page has no labelled arrays."""
        raise InputError.of("", "a report has no labelled arrays", "take those of each analysis")

    def returned(self, result: Report, files: Settings) -> Report:
        """Write the page."""
        result.save(files["path"])
        return result.in_file(Path(files["path"]))


ANALYSIS = ReportAnalysis()
