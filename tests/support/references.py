"""References that take long, in arithmetic of many digits: computed once and kept in
tests/data/references.json.

`python -m tests.support.references` computes all of them again and writes that file;
`tests/docs/test_references.py` does so with some of each kind. What is looked up is exact doubles
and where those differ (another machine's exp may do so in the last bit) a reference is computed
on the spot: slow, never wrong.
"""

from __future__ import annotations

import functools
import json
import re
import sys
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np

from tests.support import paths

DATA = paths.DATA / "references.json"
MP = mpmath.mp.clone()
MP.dps = 40
DIGITS = 30
"""Of what is kept."""
KEPT: dict[str, Callable[..., Any]] = {}
"""Every function whose values are kept."""


def plain(value: Any) -> Any:
    """Numbers, and lists and tables of them, as JSON has them; doubles keep every bit, longer
    numbers `DIGITS`."""
    if isinstance(value, dict):
        return {"table": {name: plain(item) for name, item in value.items()}}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [plain(item) for item in value]
    if isinstance(value, (str, bool, int)) or value is None:
        return value
    if isinstance(value, (complex, np.complexfloating)) or hasattr(value, "_mpc_"):
        return {"complex": [plain(value.real), plain(value.imag)]}
    return {"digits": mpmath.nstr(value, DIGITS)} if hasattr(value, "_mpf_") else float(value)


def numbers(value: Any) -> Any:
    """The same backwards."""
    if isinstance(value, list):
        return [numbers(item) for item in value]
    if not isinstance(value, dict):
        return value
    ((kind, inner),) = value.items()
    if kind == "table":
        return {name: numbers(item) for name, item in inner.items()}
    if kind == "digits":
        return MP.mpf(inner)
    real, imag = map(numbers, inner)
    return complex(real, imag) if isinstance(real, float) else MP.mpc(real, imag)


@functools.cache
def _known() -> dict[str, dict[str, Any]]:
    stored = json.loads(DATA.read_text()) if DATA.exists() else {}
    return {
        name: {json.dumps(item["of"]): item["is"] for item in items}
        for name, items in stored.items()
    }


_found: dict[str, dict[str, Any]] = {}
_anew: list[bool] = []


def kept(function: Callable[..., Any]) -> Callable[..., Any]:
    """Look the values of a function up; its arguments and values are numbers, and lists and tables
    of them."""
    name = f"{function.__module__.rsplit('.', 1)[-1]}.{function.__name__}"
    KEPT[name] = function

    @functools.wraps(function)
    def looked_up(*arguments: Any) -> Any:
        key = json.dumps(plain(arguments))
        known = (_found if _anew else _known()).get(name, {})
        if key not in known:
            known = _found.setdefault(name, {})
            known[key] = plain(function(*arguments))
        return numbers(known[key])

    return looked_up


def stored(name: str) -> list[tuple[list[Any], Any]]:
    """Arguments and values that are kept of a function."""
    return [
        (numbers(json.loads(key)), numbers(value)) for key, value in _known().get(name, {}).items()
    ]


def main() -> None:
    """Run the tests that look something up, with nothing known, and keep what they found."""
    import pytest

    from tests.support import references

    references._anew.append(True)  # this file is another module when it is run as a program
    uses = re.compile(
        r"from tests\.support\.references import kept|from tests\.support\.couplings import .*exact"
    )
    users = [
        file for file in (paths.ROOT / "tests").rglob("test_*.py") if uses.search(file.read_text())
    ]
    code = pytest.main(["-q", "-p", "no:cacheprovider", *sorted(map(str, users))])
    if code == 0:
        DATA.parent.mkdir(exist_ok=True)
        rows = {
            name: [{"of": json.loads(key), "is": value} for key, value in sorted(items.items())]
            for name, items in sorted(references._found.items())
        }
        text = ",\n".join(
            f"{json.dumps(name)}: [\n" + ",\n".join(map(json.dumps, items)) + "\n]"
            for name, items in rows.items()
        )
        DATA.write_text("{\n" + text + "\n}\n")
    sys.exit(code)


if __name__ == "__main__":
    main()
