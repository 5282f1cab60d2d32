"""Locked stages: held with the support, exactly, in every model and analysis."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.conventions import SUPPORT
from suspension_cli.design import reader
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import eigenmodes
from suspension_cli.models import registry
from suspension_cli.models.string import linear_model
from suspension_cli.models.surroundings import nominal_positions, with_dampers
from tests.support.commandline import run, written


def locked(name: str, *stages: str) -> sus.Design:
    return sus.example(name).replace({f"stage.{stage}.locked": True for stage in stages})


def lower_stage_of_double() -> sus.Design:
    raw = tomllib.loads(sus.example("double").text)
    raw["stage"] = raw["stage"][1:]
    return sus.parse(reader.write_toml(raw))


@pytest.mark.parametrize("model", registry.FILES)
def test_double_with_locked_upper_stage_is_the_lower_single(model):
    chosen = registry.by_name(model)
    double, single = (
        eigenmodes.solve(chosen.system(design.design)).omega_squared
        for design in (locked("double", "upper"), lower_stage_of_double())
    )
    np.testing.assert_allclose(double, single, rtol=1e-12)


def test_responses_are_those_of_the_lower_single():
    options = {"inputs": "support.x", "outputs": ["test.x", "test.pitch"], "frequency": "0.2:20:9"}
    double = sus.response(locked("double", "upper"), **options)
    single = sus.response(lower_stage_of_double(), **options)
    np.testing.assert_allclose(double.value, single.value, rtol=1e-9)


HELD = {
    "reaction-chain": ["top", "middle"],
    "tower": ["platform"],
    "cryogenic-payload": ["marionette"],
    "payload-recoil-mass": ["marionette"],
    "triple-damped": ["upper"],
}


@pytest.mark.parametrize("name", HELD)
def test_matrices_are_those_of_the_coordinates_that_are_free(name):
    """Rows and columns of the held bodies, and of blades on what is above, are struck out."""
    compare_free_coordinates(sus.example(name), *HELD[name])


def compare_free_coordinates(design: sus.Design, *held: str) -> None:
    def system(design):
        scene = expand(design.design)
        made = linear_model(scene, split=False)
        return with_dampers(made, design.design, nominal_positions(design.design))

    free = system(design.replace({f"stage.{stage}.locked": True for stage in held}))
    whole = system(design)
    rows = [whole.coordinate.index(one) for one in free.coordinate if not one.startswith(SUPPORT)]
    for quantity in ("mass", "stiffness", "damping"):
        wanted = getattr(whole, quantity)[np.ix_(rows, rows)]
        own = getattr(free, quantity)[6:, 6:]
        np.testing.assert_allclose(own, wanted, rtol=1e-9, atol=1e-11 * np.abs(wanted).max())


STRANDS = {"to": [0.05, 0.1, 0.02], "material": "aluminium", "diameter": 1e-3}


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize(
    "element",
    [
        {"strands": STRANDS | {"shape": "u", "length": 1.8}},
        {"strands": STRANDS | {"shape": "points", "points": [[0.0, 0.2, -0.4]]}},
        {"stiffness": [1e3, 2e3, 3e3, 4.0, 5.0, 6.0], "damping": [1.0, 2.0, 3.0, 0.4, 0.5, 0.6]},
    ],
)
def test_links_to_locked_stages_end_at_the_support(element, swapped):
    raw = tomllib.loads(sus.example("quadruple").text)
    ends = ["upper", "test"]
    link = {"name": "cable", "between": ends[::-1] if swapped else ends, "at": [0.02, 0.03, 0.04]}
    raw["link"] = [link | element]
    compare_free_coordinates(sus.parse(reader.write_toml(raw)), "upper")


def test_analyses_say_what_is_locked(tmp_path):
    file = written(tmp_path, sus.example("double").text, "double.toml")
    held = ["--set", "stage.upper.locked=true"]
    assert "locked, so at rest with the support: upper" in run("check", file, *held).stdout
    assert ", upper locked" in run("modes", file, *held, "--out", tmp_path, "--no-plot").stdout
    figure = sus.draw(locked("double", "upper"))
    assert any("upper locked" in text.get_text() for text in figure.texts)


def test_numbers_of_locked_stages_have_no_effect():
    design = locked("double", "upper")
    for path, matters in (("stage.upper.body.mass", False), ("stage.test.wires.s", True)):
        found = sus.sweep(design, vary={path: [design[path], 1.1 * design[path]]})
        assert (np.ptp(found.value, axis=0).max() > 0) == matters


@pytest.mark.parametrize(
    ("name", "stages", "key", "problem"),
    [
        ("double", ["test"], "stage.test.locked", "leaves nothing that moves"),
        ("payload-recoil-mass", ["mirror"], "stage.marionette.locked", "recoil-mass hangs from it"),
    ],
)
def test_refusals(name, stages, key, problem):
    with pytest.raises(sus.InputError) as refused:
        locked(name, *stages)
    (fault,) = refused.value.faults
    assert fault.key == key and problem in fault.problem


@pytest.mark.parametrize(
    ("analysis", "option", "text"),
    [
        (sus.response, "outputs", "upper.x"),
        (sus.response, "inputs", "upper.force_x"),
        (sus.response, "outputs", "test~upper.x"),
        (sus.thermal, "outputs", "upper.pitch@0,0,1e-3"),
        (sus.sensitivity, "results", "Q of upper pitch"),
        (sus.sensitivity, "results", "test.x/upper.force_x:3"),
        (sus.compare, "results", "tension upper.1"),
    ],
)
def test_results_of_locked_stages_are_refused(analysis, option, text):
    designs = [locked("double", "upper")] * (2 if analysis is sus.compare else 1)
    with pytest.raises(sus.InputError, match="upper is locked, so it is at rest") as refused:
        analysis(*designs, **{option: [text]})
    assert text in str(refused.value)


def test_requirements_on_locked_stages_have_no_effect(tmp_path):
    text = sus.example("double").text
    for stage in ("upper", "test"):
        text += f'[[requirement]]\nquantity = "{stage} pitch"\nat_most = 6.0\n'
    file = written(tmp_path, text, "double.toml")
    printed = run("check", file, "--set", "stage.upper.locked=true").stdout
    assert "requirements without effect, of stages at rest: upper pitch" in printed
    assert "without effect" not in run("check", file).stdout
