"""Which modes can be damped: from another body, in another band, or not judged."""

from __future__ import annotations

import json

import numpy as np

import suspension_cli as sus
from tests.support.commandline import modes_json, run
from tests.support.paths import CONFIGS

DOUBLE = CONFIGS / "double.toml"


def expected(modes, low, high, fraction):
    words = []
    for mode in modes:
        frequency = mode["frequency_hz"]
        if low <= frequency <= high:
            words.append("can be damped" if fraction[mode["label"]] >= 0.01 else "couples weakly")
        else:
            words.append(f"below {low:g} Hz" if frequency < low else f"above {high:g} Hz")
    return words


def test_the_band_and_the_body_decide(tmp_path):
    """From the mirror all modes of the band are damped that leave 1 % of their energy there: those
    of which the other body has less than 99 %."""
    flags = ("--out", tmp_path, "--no-plot", "--set", "stage.upper.wires.k=1e7")
    top = modes_json(DOUBLE, *flags)
    share = {mode["label"]: mode["top_mass_fraction"] for mode in top["modes"]}
    assert top["damping"] == {"band_hz": [0.5, 5.0], "at": "top"}
    assert [mode["verdict"] for mode in top["modes"]] == expected(top["modes"], 0.5, 5.0, share)
    test = modes_json(DOUBLE, *flags, "--damping", "band=1:1000,at=test")
    assert test["damping"] == {"band_hz": [1.0, 1000.0], "at": "test"}
    mirror = {label: 1 - fraction for label, fraction in share.items()}
    words = expected(test["modes"], 1.0, 1000.0, mirror)
    assert [mode["verdict"] for mode in test["modes"]] == words
    assert {"can be damped", "couples weakly", "below 1 Hz"} <= set(words)
    assert [mode["top_mass_fraction"] for mode in test["modes"]] == [*share.values()]
    shown = run("modes", DOUBLE, *flags, "--damping", "band=1:1000,at=test").stdout
    assert "why it cannot be damped at test" in shown
    assert "couples weakly" in shown


def test_a_stage_called_top_is_not_that_of_other_chains():
    """In a reaction chain each mode is judged by the top mass of its own chain."""
    found = sus.modes(sus.read(CONFIGS / "reaction-chain.toml"), fidelity="string")
    assert "top" in found.body
    rows = found.document()["modes"]
    share = {mode["label"]: mode["top_mass_fraction"] for mode in rows}
    assert [mode["verdict"] for mode in rows] == expected(rows, 0.5, 5.0, share)
    reaction = found.energy[:, [name != "top" for name in found.body]].sum((1, 2)) > 0.999
    assert "can be damped" in np.array(found.verdict)[reaction]


def test_towers_are_judged_if_asked():
    tower = sus.read(CONFIGS / "tower.toml")
    plain = sus.modes(tower)
    assert plain.document()["damping"] is None
    assert {mode["verdict"] for mode in plain.document()["modes"]} == {None}
    assert "why it cannot be damped" not in str(plain)
    asked = sus.modes(tower, damping={"at": "marionette"})
    assert {"can be damped", "couples weakly", "below 0.5 Hz", "above 5 Hz"} == set(asked.verdict)
    none = sus.modes(sus.read(DOUBLE), damping="none")
    assert set(none.verdict) == {""}
    assert json.loads(json.dumps(none.document()))["damping"] is None
