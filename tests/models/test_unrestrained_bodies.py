"""Where straight wires do not restrain a body, no number gives the effect of bending: it is said
in words."""

from __future__ import annotations

import pytest

from tests.support.commandline import run, strict_json
from tests.support.golden import ROOT

FILE = ROOT / "configs" / "husman2000" / "figure6.toml"
TIPPING = ("--set", "stage.test.wires.s=0", "--set", "stage.test.wires.d=-0.0001")
"""Wires that end 0.1 mm below the COM: straight ones let it tip over, bent ones do not."""
TIPS = "it decides whether test pitch is stable"


@pytest.mark.parametrize("command", ["modes", "info"])
def test_what_straight_wires_do_not_hold(command, tmp_path):
    words = ("--fidelity", "string", "--no-plot", "--out", tmp_path) if command == "modes" else ()
    done = run(command, FILE, *TIPPING, *words)
    assert done.exit_code == 0, done.stderr
    assert (TIPS if command == "modes" else "without bound") in done.stdout
    assert " inf" not in done.stdout and "(inf" not in done.stdout
    answer = strict_json(run(command, FILE, *TIPPING, *words, "--json").stdout)
    if command == "modes":
        assert answer["estimated_error"] is None and TIPS in answer["error_unknown"]
    else:
        errors = {one["fidelity"]: one["estimated_error"] for one in answer["errors"][::2]}
        assert errors["string"] is None and errors["beam"] < 1e-3
