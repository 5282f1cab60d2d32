"""Results files that are written again: messages, and pictures of the result before."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Collection, Iterator
from itertools import pairwise
from pathlib import Path

from suspension_cli.design.reader import Source
from suspension_cli.files.hdf5 import read_command, read_design, reads_alike

OURS = b"Software\0pendsus"
"""What the first bytes of a picture of this program contain."""
ENDS = r"(-\d+|-wires|-responses)?"
"""Ends of the names of pictures of one result."""
HEAD = 1000
"""How many of them are read."""


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


def remove_old_pictures(path: Path, written: Collection[Path], say: Callable[[str], None]) -> None:
    """Remove the pictures of the result that a results file held before, and report it.

    They are PNG files of this program under the names that it gives, but those just `written`.
    """
    name = re.compile(re.escape(path.stem) + ENDS)
    for picture in sorted(path.parent.glob("*.png")):
        old = name.fullmatch(picture.stem) and picture not in written
        if not old or not _is_ours(picture):
            continue
        with contextlib.suppress(OSError):
            picture.unlink()
            say(f"removed {picture}, the picture of the result before")


def _is_ours(picture: Path) -> bool:
    """Whether a PNG file was written by this program."""
    try:
        with picture.open("rb") as stream:
            return OURS in stream.read(HEAD)
    except OSError:
        return False
