"""Which body commands take without --output: the mirror, wherever the file lists it; and the top
mass of each chain."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.conventions import DOFS
from tests.support.commandline import run

BODY = """
[[stage]]
name = "{name}"
hangs_from = "{above}"
body = {{ mass = {mass}, inertia = [0.02, 0.015, 0.025] }}
[stage.wires]
count = 4
l = 0.3
s = 0.02
t1 = 0.05
t2 = 0.05
d_upper = 0.001
d = 0.001
material = "steel302"
radius = 100e-6
"""
LOOP = """
[[control.loop]]
name = "swing"
sensor = "a.x"
actuator = "a.force_x"
damper = 2.0
"""
BESIDE = (("a", "support"), ("b", "a"), ("recoil", "a"))
"""A recoil mass that the file lists last."""


def tree(*rows: tuple[str, str], more: str = "", mirror: str = "") -> str:
    text = '[design]\nname = "tree"\n' + "".join(
        BODY.format(name=name, above=above, mass=2.0 + 0.1 * n)
        for n, (name, above) in enumerate(rows)
    )
    return text.replace(f'name = "{mirror}"\n', f'name = "{mirror}"\nmirror = true\n') + more


@pytest.mark.parametrize(
    ("rows", "mirror", "expected"),
    [
        (BESIDE, "", "b"),
        (BESIDE, "recoil", "recoil"),
        (BESIDE, "a", "a"),
        # a ring that dampens the first mass, listed before what hangs below
        ((("a", "support"), ("ring", "a"), ("b", "a"), ("c", "b")), "", "c"),
        # a chain beside it
        ((("a", "support"), ("b", "a"), ("r", "support"), ("s", "r")), "", "b"),
        ((("a", "support"), ("b", "a"), ("r", "support"), ("s", "r")), "s", "s"),
    ],
)
def test_the_mirror_is_the_end_of_the_longest_chain_unless_the_file_says_it(rows, mirror, expected):
    design = sus.parse(tree(*rows, mirror=mirror))
    found = sus.response(design, frequency=[1.0], fidelity="string")
    assert found.document()["output"] == f"{expected}.x"


@pytest.mark.parametrize(
    ("command", "options", "expected"),
    [
        ("response", ("--frequency", "1"), ["b.x"]),
        ("thermal", ("--frequency", "1"), ["b.x"]),
        ("budget", ("--ground", "nhnm", "--frequency", "1:2:2"), ["b.x", "b.pitch", "b.yaw"]),
        ("damp", (), ["b.x"]),
        (
            "export",
            (),
            [f"{body}.{dof}" for body in "ab" for dof in DOFS],
        ),
        ("xcouple", ("--matrix",), [f"b.{dof}" for dof in DOFS]),
        ("compare", ("--input", "support.x", "--frequency", "1"), ["b.x"]),
    ],
)
def test_no_command_takes_the_recoil_mass_because_it_is_last(tmp_path, command, options, expected):
    file = tmp_path / "tree.toml"
    file.write_text(tree(*BESIDE, more=LOOP))
    options = (*options, "--json", "--out", tmp_path, "--no-plot")
    result = run(command, *([file] * (1 + (command == "compare"))), *options)
    assert result.exit_code == 0, result.stderr
    document = json.loads(result.stdout)
    text = json.dumps({**document, "state": [], "poles": []})
    assert all(f'"{name}' in text for name in expected), text[:1000]
    assert not re.findall(r'"recoil\.(?:x|y|z|roll|pitch|yaw)', text)


@pytest.mark.parametrize("fidelity", ["string", "violin"])
def test_the_top_mass_is_that_of_the_chain_that_moves(fidelity, tmp_path):
    alone = (("a", "support"), ("b", "a"))
    beside = tuple((f"r{name}", "support" if above == "support" else "ra") for name, above in alone)
    both = sus.parse(tree(*alone, *beside))
    found = sus.modes(both, fidelity=fidelity, max_frequency=200.0)
    single = sus.modes(sus.parse(tree(*alone)), fidelity=fidelity, max_frequency=200.0)
    first = np.array([home.startswith(("a ", "b ", "a.", "b.")) for home in found.label])
    # the chains do not touch: each has the modes and the fractions that it has alone
    np.testing.assert_allclose(found.top_fraction[first], single.top_fraction, atol=1e-8)
    assert (found.top_fraction[~first & (found.order == 0)] > 1e-3).any()
    found.save(tmp_path / "modes.h5")
    again = sus.load(tmp_path / "modes.h5").document()["modes"]
    assert again == found.document()["modes"]
    loaded = {mode["label"]: mode["verdict"] for mode in again}
    assert loaded["ra longitudinal"] == loaded["a longitudinal"] == "can be damped"
