"""Messages about results files that are written again."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

from suspension_cli.design.reader import Source
from suspension_cli.files.hdf5 import read_command, read_design, reads_alike


@contextlib.contextmanager
def replacing(path: Path, design: Source, say: Callable[[str], None]) -> Iterator[None]:
    """Report that the result of a design was written, and if it replaced that of another design.

    A file that was edited since is the same design, with the same changes by --set and --tie.
    """
    before = read_design(path)
    words = read_command(path)
    changes = {word for option, word in pairwise(words) if option in ("--set", "--tie")}
    same_changes = changes == {*design.overrides, *design.ties}
    edited = bool(design.file) and design.file in words and same_changes
    yield
    replaced = before is not None and not edited and not reads_alike(before, design.text)
    note = " (replaced the result of another design of this name; to keep both, give --name)"
    say(f"wrote {path}{note if replaced else ''}")
