"""Run the commands and edits of docs/tutorial.md and docs/diagnosis.md in a temporary folder.

`make tutorial` copies the output and pictures of the commands into the pages;
`tests/docs/test_tutorial.py` compares the two. A line `...` in a page stands for any number of
lines; such an output is left as it is.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from click.testing import CliRunner

from suspension_cli.cli.main import main as pendsus

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
PAGES: dict[str, Path | None] = {
    "tutorial": None,
    "diagnosis": ROOT / "measured" / "diagnosis",
}
"""Names of the pages, and the folder of the files that each starts with."""
PART = re.compile(
    r"^```(console|toml)\n(.*?)^```$|^!\[[^]]*\]\((images/[^)]*)\)$", re.MULTILINE | re.DOTALL
)


@dataclass(frozen=True)
class Step:
    """One command, edit or picture of the page.

    Attributes
    ----------
    kind : str
        console, toml or picture.
    text : str
        Text in the page.
    span : tuple of int
        Its start and end there.
    found : str or Path
        Output of the program (console) or file of the picture (picture).
    """

    kind: str
    text: str
    span: tuple[int, int]
    found: str | Path = ""


@contextmanager
def folder(files: Path | None = None) -> Iterator[Path]:
    """Work in a temporary copy of a folder, or an empty one; the old one is restored afterwards."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as name:
        if files is not None:
            shutil.copytree(files, name, dirs_exist_ok=True)
        os.chdir(name)
        try:
            yield Path(name)
        finally:
            os.chdir(before)


def steps(page: str) -> Iterator[Step]:
    """Run the steps of the page in the current folder.

    The picture `images/PAGE-KIND.png` is the last `NAME-KIND.png` that was written.
    """
    drawn: dict[str, Path] = {}
    design = None
    for part in PART.finditer(page):
        if part[1] == "console":
            line = part[2].partition("\n")[0].removeprefix("$ ")
            printed = run_command(line)
            drawn |= {
                kind_of(name): Path(name) for name in re.findall(r"wrote (\S+\.png)", printed)
            }
            design = design or next(
                Path(word) for word in shlex.split(line) if word.endswith(".toml")
            )
            yield Step("console", part[2], part.span(2), f"$ {line}\n{printed}")
        elif part[1] == "toml":
            assert design is not None
            design.write_text(replace_last_table(design.read_text(), part[2]))
            yield Step("toml", part[2], part.span(2))
        else:
            yield Step("picture", part[3], part.span(3), drawn[kind_of(part[3])])


def kind_of(picture: str) -> str:
    """Kind of a picture.

    >>> kind_of("results/my-fit-responses.png")
    'fit-responses.png'
    """
    return Path(picture).name.partition("-")[2]


def replace_last_table(design: str, table: str) -> str:
    """Replace the last table of a design from the heading of `table` on."""
    return design[: design.rindex(table.partition("\n")[0])] + table


def run_command(line: str) -> str:
    """Run a command and return its output, both streams as in a terminal."""
    result = CliRunner().invoke(pendsus, shlex.split(line)[1:], prog_name="pendsus")
    if result.exit_code:
        raise SystemExit(f"{line}\n{result.output}")
    return result.output


def main() -> None:
    """Regenerate the pages and their pictures."""
    for name, files in PAGES.items():
        regenerate(DOCS / f"{name}.md", files)


def regenerate(file: Path, files: Path | None) -> None:
    """Regenerate a page and its pictures."""
    page = file.read_text(encoding="utf-8")
    pieces, done = [], 0
    with folder(files):
        for step in steps(page):
            if step.kind == "console" and "\n...\n" not in step.text:
                pieces += [page[done : step.span[0]], str(step.found)]
                done = step.span[1]
            elif step.kind == "picture":
                target = file.parent / step.text
                target.parent.mkdir(exist_ok=True)
                shutil.copy(step.found, target)
    file.write_text("".join([*pieces, page[done:]]), encoding="utf-8")


if __name__ == "__main__":
    main()
