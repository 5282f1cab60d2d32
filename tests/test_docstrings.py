"""Examples in docstrings give the results that they show."""

import doctest
import importlib
from pathlib import Path

import numpy as np
import pytest

import suspension_cli

PACKAGE = Path(suspension_cli.__file__).parent
ELSEWHERE = ("api.py", "arrays.py")
"""api.py is tested with the API; the class of scene/arrays.py is in another docstring."""
MODULES = [
    ".".join(file.relative_to(PACKAGE.parent).with_suffix("").parts)
    for file in sorted(PACKAGE.rglob("*.py"))
    if file.name not in ELSEWHERE and ">>> " in file.read_text()
]


@pytest.mark.parametrize("name", MODULES)
def test_examples(name):
    found = doctest.testmod(importlib.import_module(name), extraglobs={"np": np})
    assert found.attempted
    assert not found.failed
