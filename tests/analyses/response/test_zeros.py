"""A response that symmetry makes 0 is stored as 0, and a remark in text and pictures."""

from __future__ import annotations

from typing import Any

import pytest

from tests.support.commandline import run, strict_json
from tests.support.paths import CONFIGS

ZEROS = [
    ("double", "test.y"),
    ("tower", "mirror.z"),  # three legs at 120 degrees
    ("pulled-fibres", "mirror.z@0,0,0.01"),  # three wires on three blades
    ("reaction-chain", "top.z"),  # a chain beside another
]


@pytest.mark.parametrize(("name", "output"), ZEROS)
def test_zero_is_exact_and_said(tmp_path: Any, name: str, output: str) -> None:
    ends = ("--output", output, "--frequency", "0.1:100:5", "--out", tmp_path)
    found = run("response", CONFIGS / f"{name}.toml", *ends, "--no-plot")
    assert f"support.x -> {output}: 0 by symmetry" in found.stdout.splitlines()
    document = strict_json(run("response", CONFIGS / f"{name}.toml", *ends, "--json").stdout)
    assert document["real"] == document["imag"] == [0.0] * 5


def test_comparison_of_zeros(tmp_path: Any) -> None:
    designs = [CONFIGS / "double.toml", CONFIGS / "geo-silica-triple.toml"]
    ends = ("--output", "test.y", "--frequency", "0.1:100:9", "--out", tmp_path)
    found = run("compare", *designs, *ends)
    assert found.exit_code == 0
    assert "0 by symmetry: double, geo-silica-triple" in found.stdout
    assert len(list(tmp_path.glob("*test.y*.png"))) == 1
