"""Files read and written as a whole: every failure is an `InputError`.

What is written is there whole or not at all. What others wrote is read up to a size; `kind` says
what such a file should be, for the remedy of a message: ``a TOML file``. Only where `pipe` is true
may it be other than a regular file, which ends.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO

from suspension_cli.errors import InputError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

TOML = 4_000_000
TEXT = 64_000_000
DATA = 256_000_000
"""Largest design or table that it names, table of measured numbers, other file of data; bytes."""


def replace_file(path: Path, data: bytes | Callable[[IO[bytes]], None]) -> None:
    """Write a file under a temporary name in its folder, then rename it; may raise `OSError`.

    Data that are too large for memory are written by a function into the opened file.
    Of a symbolic link the target is replaced. A device or pipe is written as it is. Temporary files
    of the same name that killed processes left are removed.
    """
    if not is_regular(path, follow=True):
        with path.open("wb") as stream:
            _fill(stream, data)
        return
    path = target(path)
    remove_leftovers(path)
    handle, temporary = _create_temporary(path)
    try:
        with os.fdopen(handle, "w+b") as stream:
            _fill(stream, data)
            stream.flush()
            os.fsync(stream.fileno())
            umask = os.umask(0)
            os.umask(umask)
            os.chmod(temporary, 0o666 & ~umask)
            if fcntl is None:
                stream.close()  # Windows renames no open file
            os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise


def _fill(stream: IO[bytes], data: bytes | Callable[[IO[bytes]], None]) -> None:
    if isinstance(data, bytes):
        stream.write(data)
    else:
        data(stream)


def _create_temporary(path: Path) -> tuple[int, str]:
    """Create a file beside another, locked while it is open: so it is not taken for a leftover."""
    while True:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        # another process may remove it between these two steps
        if lock(handle) is not False and os.path.exists(name):
            return handle, name
        os.close(handle)


def lock(handle: int) -> bool | None:
    """Lock an open file until it is closed; False if it already is, None where there are no locks.

    The system unlocks the files of a process that ends, however it ends.
    """
    if fcntl is None:
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None  # a file system without locks
    return True


def remove_leftovers(path: Path) -> None:
    """Remove temporary files for a path that no process is writing, as a kill leaves them.

    Where files cannot be locked they stay.
    """
    if fcntl is None:
        return
    is_temporary = re.compile(re.escape(f".{path.name}.") + "[a-z0-9_]{8}").fullmatch
    with contextlib.suppress(OSError):
        for name in filter(is_temporary, os.listdir(path.parent)):
            _remove_unless_locked(path.with_name(name))


def _remove_unless_locked(path: Path) -> None:
    with contextlib.suppress(OSError):
        handle = os.open(path, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK)
        try:
            if stat.S_ISREG(os.fstat(handle).st_mode) and lock(handle):
                os.unlink(path)
        finally:
            os.close(handle)


def target(path: Path) -> Path:
    """The file that a symbolic link leads to; any other path as it is."""
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def is_regular(path: Path, *, follow: bool = False) -> bool:
    """Whether a path is free or has a regular file: no device, pipe, folder, unfollowed link."""
    try:
        return stat.S_ISREG(os.stat(path, follow_symlinks=follow).st_mode)
    except FileNotFoundError:
        return True


@contextlib.contextmanager
def writing_to(path: str | Path, key: str = "--out") -> Iterator[None]:
    """Turn a failure to write to `path`, which the option `key` gave, into an `InputError`."""
    try:
        yield
    except OSError as error:
        problem = f"cannot be written ({error.strerror or error})"
        remedy = "name a folder with space and permission"
        raise InputError.of(key, problem, remedy, str(path)) from None


def write_bytes(path: Path, data: bytes, key: str = "--out") -> None:
    """Write a file whole or not at all; raises `InputError`, arguments as for `writing_to`."""
    with writing_to(path, key):
        replace_file(path, data)


def copy_file(source: Path, path: Path) -> None:
    """Write a copy of a file whole or not at all; raises `InputError`."""
    with writing_to(path), source.open("rb") as original:
        replace_file(path, lambda stream: shutil.copyfileobj(original, stream))


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
