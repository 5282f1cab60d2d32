"""Files written whole or not at all; failures to write are errors of the input."""

from __future__ import annotations

import contextlib
import os
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

from suspension_cli.errors import InputError


def replace_file(path: Path, data: bytes) -> None:
    """Write a file under a temporary name in its folder, then rename it; may raise `OSError`.

    Of a symbolic link the target is replaced. A device or pipe is written as it is.
    """
    if not is_regular(path, follow=True):
        with path.open("wb") as stream:
            stream.write(data)
        return
    path = target(path)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(temporary, 0o666 & ~umask)
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise


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
