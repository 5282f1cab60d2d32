"""Designs near a limit are reported, with a number that is right; ordinary ones are not."""

from __future__ import annotations

import re

import pytest
import tomli_w

from suspension_cli.analyses.check import limits, statics
from suspension_cli.design.reader import convert
from suspension_cli.linear import eigenmodes
from suspension_cli.models import registry
from tests.support.commandline import run
from tests.support.golden import ROOT
from tools.stability import geometry
from tools.stability.references import MP, document


def near(raw, level="string"):
    design = convert(raw)
    model = registry.by_name(level).system(design)
    return limits.find_limits(design, model, eigenmodes.solve(model))


def written(tmp_path, raw):
    path = tmp_path / "design.toml"
    path.write_text(tomli_w.dumps(raw))
    return path


def test_an_ordinary_design_is_near_nothing():
    for level in ("force", "string"):
        assert near(document(), level) == limits.Limits(None, None, 0.0)


@pytest.mark.parametrize(
    "config", sorted((ROOT / "configs").rglob("*.toml")), ids=lambda path: path.stem
)
def test_no_shipped_design_is_near_a_limit(config, tmp_path):
    result = run("modes", config, "--fidelity", "string", "--no-plot", "--out", tmp_path)
    assert result.exit_code == 0
    for word in ("close to unstable", "go slack", "has a residual"):
        assert word not in result.stderr


@pytest.mark.parametrize("above", [2e-5, 8e-5, 2e-4])
def test_reported_height_is_where_it_tips(above):
    d = float(geometry.tipping_height()) + above
    reported = near(document(s=geometry.CLOSE, d=d)).tipping
    if above > limits.TIPPING:
        assert reported is None
    else:
        assert reported is not None
        assert reported.name == "test pitch"
        assert reported.value == pytest.approx(above, rel=0.05)  # the mode's x goes along a little


@pytest.mark.parametrize("left", [0.5, 5e-3, 1e-5])
def test_reported_tension_is_the_one_left(left):
    change = float(geometry.slack_length() * (1 - MP.mpf(left)))
    raw = document() | {"perturbation": [{"wire": "test.1", "length_change": change}]}
    carried = statics.solve(convert(raw))
    reported = near(raw).slack
    if left > limits.SLACK:
        assert reported is None
    else:
        assert reported is not None
        assert reported.value == pytest.approx(
            min(w.tension for w in carried.wires) * 4 / sum(w.tension for w in carried.wires),
            rel=1e-9,
        )


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
