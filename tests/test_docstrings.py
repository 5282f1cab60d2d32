"""Examples in docstrings give the results that they show."""

import doctest
import importlib
from pathlib import Path

import numpy as np
import pytest

import suspension_cli

PACKAGE = Path(suspension_cli.__file__).parent
MODULES = [
    ".".join(file.relative_to(PACKAGE.parent).with_suffix("").parts)
    for file in sorted(PACKAGE.rglob("*.py"))
    if file.name not in ("api.py", "command.py")
    and ">>> " in file.read_text()  # tests/test_api.py has those
]


@pytest.mark.parametrize("name", MODULES)
def test_examples(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # some write files
    found = doctest.testmod(importlib.import_module(name), extraglobs={"np": np})
    assert found.attempted
    assert not found.failed
