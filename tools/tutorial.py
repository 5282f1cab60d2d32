"""Run the commands of README.md and docs/ whose output is shown, in a temporary folder per page.

A page shows a command as `$ pendsus ...`, and below it the output; Python whose output is shown is
a block of `python` followed by one of `text`. On a page that makes a design, blocks of TOML are
edits of it. `make tutorial` copies the output and pictures into the pages;
`tests/docs/test_tutorial.py` compares the two. A line `...` stands for any number of lines; of such
an output each line shown is replaced by the one most like it.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from difflib import SequenceMatcher
from io import StringIO
from pathlib import Path

from click.testing import CliRunner

from suspension_cli.cli.main import main as pendsus

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
SHOWN = re.compile(r"^\$ pendsus |^```text$", re.MULTILINE)
"""Start of an output that is shown."""
PAGES = {
    file.stem: file
    for file in (ROOT / "README.md", *sorted(DOCS.rglob("*.md")))
    if SHOWN.search(file.read_text(encoding="utf-8"))
}
"""Pages that show output, by name."""
FILES = {"diagnosis": ROOT / "measured" / "diagnosis"}
"""Folder of the files that a page starts with, beside the shipped folders."""
PART = re.compile(
    r"^(\$ pendsus .*\n(?:(?!```$|\$ ).*\n)*)|^```toml\n((?:(?!```$).*\n)*)"
    r"|^!\[[^]]*\]\(((?:\.\./)?images/[^)]*)\)$|^(pendsus new .*)$"
    r"|^```python\n((?:(?!```$).*\n)*)```\n\n```text\n((?:(?!```$).*\n)*)",
    re.MULTILINE,
)


@dataclass(frozen=True)
class Step:
    """One command, edit, picture or piece of Python of the page.

    Attributes
    ----------
    kind : str
        console, toml, picture or python.
    text : str
        Text in the page; of Python, the output.
    span : tuple of int
        Its start and end there.
    found : str or Path
        Output of the program (console, python) or file of the picture (picture).
    """

    kind: str
    text: str
    span: tuple[int, int]
    found: str | Path = ""


@contextmanager
def folder(page: str) -> Iterator[Path]:
    """Work in a temporary folder with the files of a page; the old one is restored afterwards."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as name:
        if page in FILES:
            shutil.copytree(FILES[page], name, dirs_exist_ok=True)
        os.chdir(name)
        for shipped in ("configs", "goals", "measured"):
            Path(shipped).symlink_to(ROOT / shipped)
        try:
            yield Path(name)
        finally:
            os.chdir(before)


def steps(page: str) -> Iterator[Step]:
    """Run the steps of the page in the current folder.

    The picture `images/PAGE-KIND.png` is the last `NAME-KIND.png` that was written. All Python of a
    page shares its names.
    """
    drawn: dict[str, Path] = {}
    names: dict[str, object] = {}
    design = Path()
    for part in PART.finditer(page):
        if part[4]:
            run_command(part[4])
        elif part[1]:
            line = part[1].partition("\n")[0].removeprefix("$ ")
            printed = run_command(line)
            pictures = re.findall(r"wrote (\S+\.png)", printed)
            drawn |= {kind_of(name): Path(name) for name in pictures}
            new = re.match(r"pendsus new \S+ (\S+)", line)
            design = Path(new[1]) if new else design
            yield Step("console", part[1], part.span(1), f"$ {line}\n{printed}")
        elif part[2] and design.is_file():
            design.write_text(edit_last_table(design.read_text(), part[2]))
            yield Step("toml", part[2], part.span(2))
        elif part[3]:
            yield Step("picture", part[3], part.span(3), drawn[kind_of(part[3])])
        elif part[5] is not None:
            with redirect_stdout(StringIO()) as stream:
                exec(part[5], names)
            yield Step("python", part[6], part.span(6), stream.getvalue())


def kind_of(picture: str) -> str:
    """Kind of a picture.

    >>> kind_of("results/my-fit-responses.png")
    'fit-responses.png'
    """
    return Path(picture).name.partition("-")[2]


def edit_last_table(design: str, table: str) -> str:
    """Replace the last table of a design that has the heading of `table`, or append `table`."""
    before, _, _ = design.rpartition(table.partition("\n")[0])
    return (before or f"{design}\n") + table


def run_command(line: str) -> str:
    """Run a command and return its output, both streams as in a terminal."""
    result = CliRunner().invoke(pendsus, shlex.split(line, comments=True)[1:], prog_name="pendsus")
    if result.exit_code:
        raise SystemExit(f"{line}\n{result.output}")
    return result.output


def renew(shown: str, output: str) -> str:
    """Replace what is shown of an output by the output, or line by line where dots omit some."""
    if "\n...\n" not in shown:
        return output
    lines = output.splitlines()

    def nearest(line: str) -> str:
        return max(lines, key=lambda other: SequenceMatcher(None, line, other).ratio())

    kept = (line if line in ("", "...") else nearest(line) for line in shown.splitlines())
    return "\n".join((*kept, ""))


def main() -> None:
    """Regenerate the pages and their pictures."""
    for name in PAGES:
        regenerate(name)


def regenerate(name: str) -> None:
    """Regenerate a page and its pictures."""
    file = PAGES[name]
    page = file.read_text(encoding="utf-8")
    pieces, done = [], 0
    with folder(name):
        for step in steps(page):
            if step.kind in ("console", "python"):
                pieces += [page[done : step.span[0]], renew(step.text, str(step.found))]
                done = step.span[1]
            elif step.kind == "picture":
                target = file.parent / step.text
                target.parent.mkdir(exist_ok=True)
                shutil.copy(step.found, target)
    file.write_text("".join([*pieces, page[done:]]), encoding="utf-8")


if __name__ == "__main__":
    main()
