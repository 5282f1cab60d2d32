"""Designs near a limit are reported, with a number that is right; ordinary ones are not."""

from __future__ import annotations

import re

import pytest
import tomli_w

from suspension_cli.analyses.check import statics, warnings
from suspension_cli.design.reader import convert
from suspension_cli.linear import eigenmodes
from suspension_cli.models import registry
from tests.support.commandline import run
from tests.support.golden import configs
from tools.stability import geometry
from tools.stability.references import MP, document


def tipping(raw):
    design = convert(raw)
    model = registry.by_name("string").system(design)
    return warnings.describe_tipping(design, eigenmodes.solve(model))


def written(tmp_path, raw):
    path = tmp_path / "design.toml"
    path.write_text(tomli_w.dumps(raw))
    return path


@pytest.mark.parametrize("config", configs(), ids=lambda path: path.stem)
def test_no_shipped_design_is_near_a_limit(config, tmp_path):
    result = run("modes", config, "--fidelity", "string", "--no-plot", "--out", tmp_path)
    assert result.exit_code == 0
    for word in ("close to unstable", "go slack"):
        assert word not in result.stderr


@pytest.mark.parametrize("above", [2e-5, 8e-5, 2e-4])
def test_reported_height_is_where_it_tips(above):
    d = float(geometry.tipping_height()) + above
    reported = tipping(document(s=geometry.CLOSE, d=d))
    if above > warnings.TIPPING:
        assert reported == ""
    else:  # the mode's x goes along a little
        assert reported.startswith("test pitch is close to unstable")
        height = float(re.search(r"the wires ([\d.]+) mm", reported)[1])
        assert height == pytest.approx(1e3 * above, rel=0.05)


@pytest.mark.parametrize("left", [0.5, 5e-3, 1e-5])
def test_reported_tension_is_the_one_left(left):
    change = float(geometry.slack_length() * (1 - MP.mpf(left)))
    raw = document() | {"perturbation": [{"wire": "test.1", "length_change": change}]}
    loads = statics.solve(convert(raw))
    reported = warnings.find_slackest(loads)
    if left > warnings.SLACK:
        assert reported == []
    else:
        tension = [wire.tension for wire in loads.wires]
        share = f"{100 * min(tension) * 4 / sum(tension):.2g} % of the mean tension"
        assert share in reported[0].problem


def test_commands_say_it(tmp_path):
    low = written(tmp_path, document(s=geometry.CLOSE, d=float(geometry.tipping_height()) + 2e-5))
    result = run(
        "response", low, "--frequency", "1", "--fidelity", "string", "--no-plot", "--out", tmp_path
    )
    assert (
        "test pitch is close to unstable: attaching the wires 0.02 mm lower makes it unstable"
        in result.stderr
    )
    change = float(geometry.slack_length() * MP.mpf("0.995"))
    loose = written(
        tmp_path, document() | {"perturbation": [{"wire": "test.1", "length_change": change}]}
    )
    for command in (
        ["check", loose],
        ["modes", loose, "--no-plot", "--fidelity", "string", "--out", tmp_path],
    ):
        assert re.search(
            r"wire test\.[14] is about to go slack: it carries 0\.\d+ % of the mean tension of its"
            r" stage",
            run(*command).stderr,
        )
