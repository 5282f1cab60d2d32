"""Mutated designs, data files, results files, options and arguments are computed or refused.

Each run spoils one valid input at random and passes it to a command or a function, in a process of
its own. A run fails on a traceback, a raw warning, NaN in JSON, an error without a line of text, a
file written in spite of an error or in part, or a minute of computing. `make mutations` does 1,000;
``python -m tools.mutations RUNS SEED`` others.
"""

from __future__ import annotations

import copy
import json
import math
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import tomllib
import traceback
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NoReturn

import h5py
import numpy as np
import tomli_w

import suspension_cli as sus
from suspension_cli.cli.main import get
from tests.support.commandline import become
from tests.support.commandline import run as run_here
from tests.support.paths import CONFIGS

MINUTE, MEMORY = 60, 6 << 30
"""Limits of one run, s and bytes."""
KINDS = ("design", "data", "results", "options", "arguments")
NAMES = ("double", "five-wires", "imperfect", "payload-recoil-mass", "triple-damped", "triple-tolerance")  # fmt: skip
DESIGNS = [*(CONFIGS / f"{name}.toml" for name in NAMES), CONFIGS / "husman2000/table1-case4.toml"]
MEASURED = CONFIGS.parent / "measured" / "triple"
GRID = ("--frequency", "0.3:10:12")
COMMANDS = {"check": (), "modes": (), "response": GRID, "thermal": GRID, "damp": GRID,
            "export": (), "budget": GRID, "sensitivity": (), "tolerance": ("--builds", "100"),
            "xcouple": ("--sweep", "k=0.9:1.1:3"), "sweep": ("--vary", "constants.gravity=9:10:3")}  # fmt: skip
ONLY_PRINT = ("check", "draw")
SIGNALS = ("--input", "upper.force_x", "--output", "upper.x")
NUMBERS = [0, -1, 1, 1e-320, 1e-12, 1e-3, 1e6, 1e20, 1e300, math.nan, math.inf, -math.inf]
TYPES = ["", "x", "test", "é\0", "nan", True, [], {}, [[1.0]], {"x": 1}]
OBJECTS = [None, [None], {"a": None}, 1j, b"x", object(), 10**30, [math.nan, 1.0], np.zeros((2, 2))]
WORDS = ["nan", "inf", "-1", "0", "1e999", "1e-320", "x", "", "test.x", "support.x@nan,0,0", "1:2",
         "0:1:3:log", "1:1e9:4", "violin", "force", "stage.test.wires.l=nan", "a.b=1", "stage=1",
         "/dev/null", "9" * 400, "\udcff", "mode = 1", "coupling < 1"]  # fmt: skip


def places(node: Any) -> list[tuple[Any, Any]]:
    """List every container and key of a document."""
    keys = range(len(node)) if isinstance(node, list) else node if isinstance(node, dict) else ()
    return [place for key in keys for place in ((node, key), *places(node[key]))]


def mutate_document(draw: random.Random, text: str) -> bytes:
    """Delete, duplicate, retype or rescale one to three keys of a TOML document."""
    raw = tomllib.loads(text)
    for _ in range(draw.choice((1, 1, 2, 3))):
        node, key = draw.choice(places(raw) or [({"x": 1}, "x")])
        how, value = draw.randrange(10), node[key]
        if how == 0:
            del node[key]
        elif how == 1 and isinstance(node, list):
            node.append(copy.deepcopy(value))
        elif how == 1:
            node[f"{key}2"] = copy.deepcopy(value)
        elif how < 4 or not isinstance(value, float):
            node[key] = copy.deepcopy(draw.choice([*NUMBERS, *TYPES]))
        else:
            power = draw.choice((draw.uniform(-1, 1), draw.randint(-3, 3), draw.randint(-12, 12)))
            node[key] = value * draw.choice((1.0, 1.0, 1.0, -1.0)) * 10.0**power
    return tomli_w.dumps(raw).encode()


def mutate_bytes(draw: random.Random, data: bytes) -> bytes:
    """Cut a file off, or flip, remove, repeat or insert bytes."""
    if draw.random() < 0.2:
        return data[: draw.randrange(len(data))]
    found = bytearray(data)
    for _ in range(draw.choice((1, 1, 3, 30))):
        at, size = draw.randrange(len(found)), draw.choice((1, 1, 8, 100))
        words = (b"nan", b"inf", b"-", b"1e999", b"\xff" * size, b"", found[at : at + size] * 2)
        patch = draw.choice((draw.randbytes(size), *words))
        found[at : at + draw.choice((len(patch), size))] = patch
    return bytes(found)


def mutate_hdf5(draw: random.Random, path: Path) -> None:
    """Delete or replace an attribute, a dataset or a group."""
    with h5py.File(path, "r+") as file:
        items: list[Any] = [file]
        file.visititems(lambda _, item: items.append(item))
        item = draw.choice(items)
        key = draw.choice([*item.attrs, None])
        if key is not None:
            item.attrs[key] = draw.choice((math.nan, "x", np.zeros(3), "", 10**9, -1))
        elif item is not file:
            name, shape = item.name, getattr(item, "shape", ())
            del file[name]
            wrong = [np.full(shape, value) for value in (math.nan, -1, 0)]
            wrong += [np.zeros(shape)[:-1] if shape else 0, "text", 3.0, np.zeros((2, 2, 2))]
            file.update({name: draw.choice(wrong)} if draw.random() < 0.8 else {})


def valid_files(folder: Path, names: Iterable[str] = COMMANDS) -> list[Path]:
    """Make results files of some commands, and a measurement in HDF5, the last."""
    for name in names:
        design = CONFIGS / f"triple-{'damped' if name == 'damp' else 'tolerance'}.toml"
        end = () if name in ONLY_PRINT else ("--no-plot", "--out", folder)
        run_here(name, design, *COMMANDS[name], *end)
    made = [path for path in sorted(folder.glob("*.h5")) if "statespace" not in path.name]
    run_here("plot", made[0], "--out", folder)  # imports what draws
    table = np.genfromtxt(MEASURED / "x.csv", delimiter=",", skip_header=2)
    with h5py.File(folder / "data.h5", "w") as file:
        file["frequency"], file["value"] = table[:, 0], table[:, 1] + 1j * table[:, 2]
    return [*made, folder / "data.h5"]


def mutation(kind: str, draw: random.Random, made: list[Path]) -> list[Any] | Callable[[], Any]:
    """Make one mutated input in this folder: the words of a command, or a call of the API."""
    file, end = Path("d.toml"), ["--json", "--no-plot", "--out", "out"]
    if kind == "design":
        text, name = draw.choice(DESIGNS).read_text(), draw.choice([*COMMANDS, "modes", "check"])
        whole = draw.random() < 0.8
        file.write_bytes(mutate_document(draw, text) if whole else mutate_bytes(draw, text.encode()))  # fmt: skip
        return [name, file, *COMMANDS[name], *(end[:1] if name in ONLY_PRINT else end)]
    if kind == "data":
        for one in (*MEASURED.iterdir(), made[-1]):
            shutil.copy(one, ".")
        file = Path(draw.choice(("x.csv", "pitch.xml", "data.h5", "data.h5", "measured.toml")))
        if file.suffix == ".h5" and draw.random() < 0.5:
            mutate_hdf5(draw, file)
        elif file.suffix == ".toml":
            file.write_bytes(mutate_document(draw, file.read_text()))
        else:
            file.write_bytes(mutate_bytes(draw, file.read_bytes()))
        given = file if file.suffix in (".h5", ".csv") else "measured.toml"
        return draw.choice((["response", "triple.toml", "--measured", given, *SIGNALS, *end],
                            ["compare", "triple.toml", given, *SIGNALS, *end]))  # fmt: skip
    if kind == "results":
        file = Path(shutil.copy(draw.choice(made[:-1]), "."))
        if draw.random() < 0.6:
            mutate_hdf5(draw, file)
        else:
            file.write_bytes(mutate_bytes(draw, file.read_bytes()))
        if draw.random() < 0.3:
            return lambda: sus.load(file)
        return draw.choice((["plot", file, *end[2:]], ["plot", file, "--csv", *end[2:]],
                            ["plot", file, made[2], "--together", *end[2:]],
                            ["compare", file, CONFIGS / "triple-tolerance.toml", *end]))  # fmt: skip
    if kind == "options":
        name = draw.choice([*COMMANDS, "compare", "plot", "optimise", "tradeoff", "draw", "fit"])
        words = [name, made[1] if name == "plot" else DESIGNS[0], *COMMANDS.get(name, ())]
        if name in ("compare", "optimise", "fit"):
            words.append(draw.choice((DESIGNS[1], made[0], "/", "/dev/null", "/dev/zero", "no")))
        known = [one for one in get(name).params if one.name not in ("out", "scheduler", "workers")]
        for param in draw.choices(known, k=draw.randint(1, 2)):
            flag = getattr(param, "is_flag", False)
            words += [*param.opts[:1]] * param.opts[0].startswith("-")
            words += [] if flag else [draw.choice(WORDS)]
        return words if name in ONLY_PRINT else [*words, *end[2:]]
    return argument(draw)


def argument(draw: random.Random) -> Callable[[], Any]:
    """Make a call of the API with one odd argument."""
    design, odd = sus.read(DESIGNS[0]), draw.choice([*NUMBERS, *TYPES, *OBJECTS, *WORDS, Path("/")])
    path = draw.choice(("analysis.modes.tolerance", "stage.1.body.mass", "stage.test.wires.l",
                        "design.title", "x", "stage", "stage.9", "constants.gravity"))  # fmt: skip
    function, name = draw.choice([
        (sus.modes, "max_frequency"), (sus.modes, "tolerance"), (sus.modes, "model"),
        (sus.response, "inputs"), (sus.response, "outputs"), (sus.response, "frequency"),
        (sus.thermal, "frequency"), (sus.thermal, "outputs"), (sus.tolerance, "builds"),
        (sus.damp, "duration"), (sus.xcouple, "sweep"), (sus.sweep, "vary"),
    ])  # fmt: skip
    return draw.choice([
        *[lambda: function(design, **{name: odd})] * 12,
        *[lambda: sus.modes(design.replace({path: odd}))] * 6,
        *[lambda one=one: one(odd) for one in (sus.modes, sus.load, sus.read, sus.parse, sus.template)],
        lambda: sus.sweep(design, vary={path: odd}), lambda: sus.xcouple(design, sweep={"k": odd}),
        lambda: sus.compare(odd, design), lambda: sus.fit(odd, design),
        lambda: sus.modes(design).save(f"out/{odd}"[:99] if isinstance(odd, str) else odd),
    ])  # fmt: skip


def call(function: Callable[[], Any], err: int) -> NoReturn:
    """Call a function and print its result; end this process as a command would."""
    os.dup2(err, 2)
    sys.stderr, code = os.fdopen(2, "w", closefd=False), 0
    try:
        result = function()
        str(result)
        json.dumps(result.document() if hasattr(result, "document") else None, allow_nan=False)
    except sus.InputError as error:
        print(error, file=sys.stderr)
        code = 2
    except BaseException:
        traceback.print_exc()
        code = 70
    sys.stderr.flush()
    os._exit(code)


def run(kind: str, seed: str, made: list[Path]) -> tuple[int, str]:
    """Make and run one mutation; return the exit code, and what went wrong ("" if nothing)."""
    with (
        tempfile.TemporaryDirectory() as name,
        tempfile.TemporaryFile() as out,
        tempfile.TemporaryFile() as err,
    ):
        child = os.fork()
        if child == 0:
            os.chdir(name)
            for limit, most in ((resource.RLIMIT_CPU, MINUTE), (resource.RLIMIT_AS, MEMORY)):
                resource.setrlimit(limit, (most, most))
            signal.alarm(10 * MINUTE)  # for what waits, on a busy machine
            what = mutation(kind, random.Random(seed), made)
            words = "a function" if callable(what) else " ".join(map(ascii, what))[:300]
            os.write(err.fileno(), f"{words}\n".encode())
            if callable(what):
                call(what, err.fileno())
            become([str(word) for word in what], out.fileno(), err.fileno())
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        for stream in (out, err):
            stream.seek(0)
        printed, lines = out.read().decode(errors="replace"), err.read().decode(errors="replace")
        words, _, lines = lines.partition("\n")
        problem = judge(code, printed, lines, Path(name))
        return code, f"{problem}\n    {words}" if problem else ""


def judge(code: int, out: str, err: str, folder: Path) -> str:
    """Say what is wrong with the end of a run; "" if nothing."""
    last = err.strip().rpartition("\n")[2][:200]
    written = [path.name for path in folder.rglob("out/*") if path.is_file()]
    partial = [name for name in written if name.startswith(".") or name.endswith(".part")]
    if code in (-signal.SIGALRM, -signal.SIGXCPU, -signal.SIGKILL):
        return "no end within a minute"
    if code not in (0, 1, 2) or "Traceback" in err:
        return f"traceback or crash ({code}): {last}"
    for wrong, problem in (
        (code == 1 and not out, f"failed: {last}"),
        ("Warning:" in err, f"raw warning: {err.strip()[:300]}"),
        (code == 2 and not last, "refused without a word"),
        (code == 0 and out.startswith("{") and ("NaN" in out or "Infinity" in out), "NaN in JSON"),
        (code == 2 and written, f"refused, but wrote {written}"),
        (partial, f"left {partial}"),
    ):
        if wrong:
            return problem
    return ""


def main(runs: int = 1000, seed: str = "1") -> int:
    """Print each failure, and how the runs of each kind ended; return the number of failures."""
    failed, codes = 0, Counter[tuple[str, int]]()
    with tempfile.TemporaryDirectory() as name:
        made = valid_files(Path(name))
        for n in range(runs):
            kind = KINDS[n % len(KINDS)]
            code, problem = run(kind, f"{kind}-{seed}-{n}", made)
            codes[kind, code] += 1
            if problem:
                failed += 1
                print(f"{kind}-{seed}-{n}: {problem}", flush=True)
            if n % 100 == 99:
                print(f"{n + 1} runs, {failed} failed", flush=True)
    for kind in KINDS:
        ends = {code: count for (one, code), count in sorted(codes.items()) if one == kind}
        print(f"{kind}: {sum(ends.values())} runs, by exit code: {ends}")
    return failed


if __name__ == "__main__":
    sys.exit(main(*(kind(word) for kind, word in zip((int, str), sys.argv[1:], strict=False))) > 0)
