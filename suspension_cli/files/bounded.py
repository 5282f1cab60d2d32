"""Bytes and text of files that others wrote: of bounded size, every failure an `InputError`.

`kind` says what a file should be, for the remedy of a message: ``a TOML file``. Only where `pipe`
is true may it be other than a regular file, which ends.
"""

from __future__ import annotations

from pathlib import Path

from suspension_cli.errors import InputError

TOML, TEXT, DATA = 4_000_000, 64_000_000, 256_000_000
"""Largest design or table that it names, table of measured numbers, other file of data; bytes."""


def read_head(path: Path, count: int, kind: str, *, pipe: bool = False) -> bytes:
    """Read the first bytes of a file, at most `count`."""
    try:
        if path.is_dir():
            raise InputError.of("", "is a directory", f"name {kind} in it")
        if not pipe and path.exists() and not path.is_file():
            raise InputError.of("", "is not a regular file", f"name {kind}")
        with path.open("rb") as stream:
            return stream.read(count)
    except (OSError, ValueError) as error:
        problem = f"cannot be read ({getattr(error, 'strerror', None) or error})"
        raise InputError.of("", problem, "check the path and its permissions") from None


def read_bytes(path: Path, most: int, kind: str, *, pipe: bool = False) -> bytes:
    """Read a whole file of at most `most` bytes."""
    return checked_size(read_head(path, most + 1, kind, pipe=pipe), most, kind)


def checked_size(data: bytes, most: int, kind: str) -> bytes:
    """Return data of at most `most` bytes; raises `InputError` for more."""
    if len(data) > most:
        problem = f"has more than {most / 1e6:g} MB, too many for {kind}"
        raise InputError.of("", problem, "check its name, or give fewer numbers")
    return data


def read_text(path: Path, most: int, kind: str, *, pipe: bool = False) -> str:
    """Read a file of at most `most` bytes as text in UTF-8, without a byte-order mark."""
    try:
        return read_bytes(path, most, kind, pipe=pipe).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError.of("", "is not text (UTF-8)", f"name {kind}") from None
