"""Where straight wires do not restrain a body, no number gives the effect of bending: it is said
in words."""

from __future__ import annotations

import h5py
import pytest

from tests.support.commandline import run, strict_json
from tests.support.golden import ROOT

FILE = ROOT / "configs" / "husman2000" / "figure6.toml"
FREE = ("--set", "stage.test.wires.s=0", "--set", "stage.test.wires.d=0")
"""Wires that end in the COM: nothing but bending holds pitch."""
TIPPING = ("--set", "stage.test.wires.s=0", "--set", "stage.test.wires.d=-0.0001")
"""Wires that end 0.1 mm below it: straight ones let it tip over."""
LEFT_FREE = "straight wires leave test pitch free, bending restrains it"
TIPS = "straight wires leave test pitch unstable, bending stabilizes it"


@pytest.mark.parametrize(
    ("shape", "more", "said"),
    [(FREE, (), LEFT_FREE), (TIPPING, (), TIPS), (TIPPING, ("--fidelity", "string"), TIPS)],
    ids=["free", "tipping", "tipping-on-string"],
)
def test_modes_say_what_straight_wires_do_not_hold(shape, more, said, tmp_path):
    done = run("modes", FILE, *shape, *more, "--no-plot", "--out", tmp_path)
    assert done.exit_code == 0, done.stderr
    assert "wire bending" in done.stdout and said in done.stdout
    assert "inf" not in done.stdout
    (path,) = tmp_path.glob("*.h5")
    with h5py.File(path) as file:
        assert said in file.attrs["fidelity_reason"]


@pytest.mark.parametrize(
    ("shape", "said"), [(FREE, LEFT_FREE), (TIPPING, TIPS)], ids=["free", "tipping"]
)
def test_info_says_it_too(shape, said):
    reported = run("info", FILE, *shape)
    assert reported.exit_code == 0, reported.stderr
    assert said in reported.stdout
    assert " inf" not in reported.stdout
    assert "(inf" not in reported.stdout
    answer = strict_json(run("info", FILE, *shape, "--json").stdout)
    assert said in answer["choices"][0]["reason"]


def test_an_indicator_without_bound_is_explained():
    reported = run("info", FILE, *FREE).stdout
    assert f"without bound: {LEFT_FREE}" in reported


def test_a_change_without_bound_is_no_number_in_json():
    """Sampled, as at such a tolerance the estimate does not settle it; strict JSON has no
    infinity."""
    shape = (*FREE[:3], "stage.test.wires.d=-0.0003")
    choice = strict_json(run("info", FILE, *shape, "--tolerance", "0.9", "--json").stdout)[
        "choices"
    ][0]
    assert choice["fidelity"] == "beam"
    assert TIPS in choice["reason"]
    assert choice["refinements"][0]["change"] is None
