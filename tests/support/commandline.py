"""The `pendsus` command as the tests call it, and what they demand of it when the input is at
fault."""

from __future__ import annotations

import copy
import json
import multiprocessing.util
import os
import subprocess
import sys
import tempfile
import threading
import traceback
import warnings
from pathlib import Path
from typing import Any, NoReturn

import tomli_w
from click.testing import CliRunner, Result

from suspension_cli.cli.main import main
from suspension_cli.design.reader import template

KINDS = ("single", "double", "triple", "blades")
MISSING = object()
"""In `edited`: take the key away."""

Raw = dict[str, Any]
Edits = dict[tuple[str | int, ...], Any]


def run(*args: str | Path) -> Result:
    """Run the command in this process; an exception that is no exit fails the test."""
    result = CliRunner().invoke(main, [str(arg) for arg in args], prog_name="pendsus")
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def process(*args: str | Path, limit: int | None = None) -> subprocess.CompletedProcess[str]:
    """Run the command as a process of its own, a copy of this one that has imported everything; it
    may write no file beyond `limit` bytes."""
    words = [str(arg) for arg in args]
    with (
        tempfile.TemporaryFile() as out,
        tempfile.TemporaryFile() as err,
        warnings.catch_warnings(),
    ):
        # idle threads of linear algebra are no hindrance
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
        if child == 0:
            become(words, out.fileno(), err.fileno(), limit)
        _, status = os.waitpid(child, 0)
        texts = []
        for stream in (out, err):
            stream.seek(0)
            texts.append(stream.read().decode())
    return subprocess.CompletedProcess(words, os.waitstatus_to_exitcode(status), *texts)


def become(words: list[str], out: int, err: int, limit: int | None = None) -> NoReturn:
    """Make this process, a copy, one of the command that writes to these files."""
    code = 70
    try:
        os.dup2(out, 1)
        os.dup2(err, 2)
        sys.stdout, sys.stderr = (os.fdopen(handle, "w", closefd=False) for handle in (1, 2))
        sys.argv = ["-c", *words]
        if limit is not None:
            import resource  # which Windows lacks

            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
        main(prog_name="pendsus")
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
    finally:
        # as at the end of an ordinary process: pools wait for their workers, and semaphores that
        # are still referenced are released, of which multiprocessing would warn otherwise
        threading._shutdown()
        multiprocessing.util._run_finalizers()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def python(code: str, *args: str | Path) -> subprocess.CompletedProcess[str]:
    """Run code as a process of its own, from the start of the interpreter on."""
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, args)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def edited(base: Raw, edits: Edits) -> Raw:
    """A copy of a parsed design with values put in (or taken away) at paths of keys and
    positions."""
    raw = copy.deepcopy(base)
    for (*way, last), value in edits.items():
        node: Any = raw
        for key in way:
            node = node.setdefault(key, {}) if isinstance(node, dict) else node[key]
        if value is MISSING:
            del node[last]
        else:
            node[last] = copy.deepcopy(value)
    return raw


def written(folder: Path, text: str | bytes | Raw, name: str = "design.toml") -> Path:
    """A design file."""
    path = folder / name
    if isinstance(text, dict):
        text = tomli_w.dumps(text)
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def from_template(folder: Path, kind: str = "single") -> Path:
    """A design file as `pendsus new` writes it."""
    return written(folder, template(kind, kind), f"{kind}.toml")


def document(command: str, *args: str | Path) -> Any:
    """What a command that must succeed prints with --json: one strict JSON document."""
    result = run(command, "--json", *args)
    assert result.exit_code == 0, result.stderr
    return strict_json(result.stdout)


def modes_json(*args: str | Path) -> Any:
    """The document of `pendsus modes`."""
    return document("modes", *args)


def strict_json(text: str) -> Any:
    """Parsed JSON; NaN and infinities are no JSON."""

    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is not JSON")

    return json.loads(text, parse_constant=refuse)


def assert_refused(result: Any, file: str | Path, out: Path | None = None) -> list[str]:
    """Demand of a run what holds for every fault of the input; returns what each line says after
    the file.

    Exit code 2; stdout empty; nothing written; on stderr only lines ``FILE: [KEY [= VALUE]:
    ]PROBLEM; REMEDY``.
    """
    code = result.exit_code if isinstance(result, Result) else result.returncode
    assert code == 2, result.stderr
    assert result.stdout == ""
    if out is not None and out.is_dir():
        assert list(out.iterdir()) == []
    lines = result.stderr.removesuffix("\n").split("\n")
    for line in lines:
        assert line.startswith(f"{file}: "), line
        assert line.isprintable(), line
        problem, semicolon, remedy = line.rpartition("; ")
        assert semicolon and remedy.strip() and problem.removeprefix(f"{file}: ").strip(), line
    return [line.removeprefix(f"{file}: ") for line in lines]
