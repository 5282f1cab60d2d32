"""Tables of what is verified, measured and fitted, from one file into all pages that show them.

A page marks the place of a table with `<!-- evidence: verified short -->`; the text from there to
`<!-- end -->` is regenerated. `short` leaves out commands and remarks. `python -m
tools.validation.evidence` renews the pages; with `--run` it runs every command and looks for the
numbers in its output.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

from suspension_cli.files.whole_files import write_bytes
from tools.tables import ROOT

FILE = Path(__file__).with_suffix(".toml")
KINDS = {
    "verified": "Verified: the same parameters, another program or method",
    "measured": "Measured: parameters that were not fitted to the measurement",
    "fitted": "Fitted: parameters chosen so that numbers agree, which is no test",
}
"""Kinds of evidence, and the titles of their tables."""
SECOND = {"verified": "compared with", "measured": "measured by", "fitted": "fitted or chosen"}
"""Title of the second column."""
PAGES = tuple(
    ROOT / name
    for name in (
        "README.md",
        "docs/accuracy.md",
        "results/validation.md",
        "paper/paper.md",
    )
)
BLOCK = re.compile(r"<!-- evidence: (\w+)((?: \w+)*) -->\n.*?<!-- end -->", re.DOTALL)


@dataclass(frozen=True)
class Row:
    """One comparison; `prints` are texts in the output of `command`."""

    what: str
    against: str
    result: str
    command: str
    prints: tuple[str, ...] = ()
    remark: str = ""


def rows(kind: str) -> list[Row]:
    """Rows of one kind."""
    raw = tomllib.loads(FILE.read_text("utf-8"))[kind]
    return [Row(**{**row, "prints": tuple(row.get("prints", ()))}) for row in raw]


def table(kind: str, options: str) -> str:
    """Table of one kind in Markdown."""
    short = "short" in options
    head = ["what", SECOND[kind], "result", *([] if short else ["printed by", "remark"])]
    lines = [head, ["---"] * len(head)]
    for row in rows(kind):
        more = [] if short else [f"`{row.command}`", row.remark]
        lines.append([row.what, row.against, row.result, *more])
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def marked(kind: str, options: str) -> list[str]:
    """Title and table of one kind with the marks between which it is renewed."""
    return [
        f"**{KINDS[kind]}**",
        "",
        f"<!-- evidence: {kind} {options} -->",
        "",
        table(kind, options),
        "",
        "<!-- end -->",
    ]


def page(text: str) -> str:
    """Regenerate the tables of a page."""
    return BLOCK.sub(
        lambda found: (
            f"<!-- evidence: {found[1]}{found[2]} -->\n\n{table(found[1], found[2])}\n\n<!-- end -->"
        ),
        text,
    )


def renew() -> None:
    """Write the tables into all pages."""
    for path in PAGES:
        write_bytes(path, page(path.read_text("utf-8")).encode())


def missing(row: Row) -> list[str]:
    """Run the command of a row; texts that it does not print, or its error."""
    words = shlex.split(row.command)
    if words[0] == "python":
        words[0] = sys.executable
    if words[0] == "pendsus":
        words = [sys.executable, "-m", "suspension_cli", *words[1:], "--no-plot"]
    done = subprocess.run(words, capture_output=True, text=True, cwd=ROOT, check=False)
    if done.returncode:
        return [done.stderr.strip().rpartition("\n")[2] or f"exit code {done.returncode}"]
    return [text for text in row.prints if text not in done.stdout]


def main() -> None:
    """Renew the pages, or run all commands."""
    if "--run" not in sys.argv:
        renew()
        return
    os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    for kind in KINDS:
        for row in rows(kind):
            absent = missing(row)
            print(f"{kind}: {row.command}: {'not printed: ' + str(absent) if absent else 'ok'}")


if __name__ == "__main__":
    main()
