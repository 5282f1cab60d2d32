"""Each kind of quantity of a random build equals that of a design with the build's imperfections.

And what a build does not have is counted, with a reason.
"""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.named_quantities import names_of
from suspension_cli.design import reader
from suspension_cli.equilibrium import nominal
from suspension_cli.models import registry
from suspension_cli.quantities import solved, vocabulary
from suspension_cli.quantities.needs import Needs
from suspension_cli.quantities.quantity import evaluate
from tests.analyses.tolerance.test_tolerance import job_of, perturbations
from tests.support import scenes
from tests.support.commandline import run, written
from tests.support.golden import CONFIGS

DAMPED = tomllib.loads((CONFIGS / "triple-damped.toml").read_text())
SCATTER = {
    "wire": [{"stage": "test", "lower": {"normal": 1e-4}, "length": {"normal": 1e-5}}],
    "body": [{"stage": "test", "com": {"normal": 1e-4}}],
}
NAMES = {
    kind.pattern: kind.example
    for kind in vocabulary.every_kind()
    if not kind.example.startswith(("dilution", "temperature"))  # these need other designs
}
DILUTION = "dilution of test longitudinal"
BUILDS = 2


@pytest.fixture(scope="module")
def computed():
    """Builds with a quantity of every kind, their values by name, and the designs they are."""
    job = job_of(DAMPED | {"tolerance": SCATTER}, BUILDS, 5, [*NAMES.values()], level="beam")
    value = job.compute(0, BUILDS)["value"]
    names = [one.text for one in job.quantities]
    designs = [
        scenes.design_of(DAMPED | {"perturbation": perturbations(job, drawn)})
        for drawn in job.deviations(0, BUILDS)
    ]
    by_name = dict(zip(names, value.T, strict=True))
    return by_name | {"5": by_name[job.followed[4].text]}, designs, job


def expect(quantity, design):
    """Value of a quantity of one design in the beam model."""
    [(_, alone)] = solved.of_designs([design], "beam", Needs.of([quantity]))
    [[value]] = evaluate([quantity], alone)
    return value


@pytest.mark.parametrize("pattern", NAMES)
def test_each_kind_is_that_of_the_imperfect_design(pattern, computed):
    """In the beam model; the fifth mode is the fifth in these builds, too."""
    values, designs, job = computed
    source = reader.Source(job.design, job.text, "")
    if NAMES[pattern] == "coupling":
        quantity = job.coupling
    else:
        quantity = vocabulary.parse(NAMES[pattern], names_of(source), "")
    for n, design in enumerate(designs):
        expected = expect(quantity, design)
        assert np.isfinite(expected) and expected != 0.0
        assert values[quantity.text][n] == pytest.approx(expected, rel=1e-6, abs=0.0)


def test_dilution_is_that_of_the_imperfect_design():
    """Of a design without loops, which alone has one."""
    raw = {key: value for key, value in DAMPED.items() if key != "control"}
    job = job_of(raw | {"tolerance": SCATTER}, BUILDS, 5, [DILUTION], level="beam")
    values = job.compute(0, BUILDS)["value"][:, -1]
    names = names_of(reader.Source(job.design, job.text, ""))
    quantity = vocabulary.parse(DILUTION, names, "")
    assert job.quantities[-1] == quantity
    for value, drawn in zip(values, job.deviations(0, BUILDS), strict=True):
        design = scenes.design_of(raw | {"perturbation": perturbations(job, drawn)})
        expected = expect(quantity, design)
        assert expected > 1.0
        assert value == pytest.approx(expected, rel=1e-6)


def test_builds_without_a_value_are_counted(tmp_path):
    """A loop whose gain is so large that it is unstable in each build has no margins: no build
    meets a requirement on these."""
    raw = tomllib.loads((CONFIGS / "triple-damped.toml").read_text()) | {"tolerance": SCATTER}
    raw["control"]["loop"][4]["gain"] *= 1e6
    file = written(tmp_path, raw)
    words = ("tolerance", file, "--builds", "3", "--workers", "1", "--out", tmp_path, "--no-plot")
    done = run(*words, "--fidelity", "string", "--require", "margin pitch.gain > 3")
    assert done.exit_code == 0, done.stderr
    assert (
        "3 of 3 builds have no margin pitch.gain: each has no margin: the closed loop is unstable"
        in done.stdout
    )
    document = sus.load(next(tmp_path.glob("*.h5"))).document()
    [found] = document["results"]
    assert (found["missing"], found["mean"]) == (3, None)
    assert document["all_requirements"]["yield"] == 0.0


def test_the_command_evaluates_the_design_as_the_function_does(tmp_path):
    """Statistics of a quantity of one build are the build's value."""
    raw = DAMPED | {"tolerance": SCATTER}
    found = sus.tolerance(
        sus.read(written(tmp_path, raw)),
        builds=1,
        results=["Q of test pitch", "margin pitch.gain"],
        fidelity="string",
        workers=1,
    )
    quality, margin = found.others
    assert quality.mean > 0 and margin.unit == "dB"
    assert found.document()["results"][0]["mean"] == quality.mean


def test_text_and_picture_follow_from_the_file_alone(tmp_path, monkeypatch):
    """Nothing is balanced or solved for them."""
    raw = DAMPED | {"tolerance": SCATTER}
    words = ("--builds", "4", "--workers", "1", "--fidelity", "string", "--no-plot", "-q")
    more = ("--require", "test pitch > 0.1", "--result", "test height", "--out", tmp_path)
    done = run("tolerance", written(tmp_path, raw), *words, *more)
    assert done.exit_code == 0, done.stderr

    def refuse(*_):
        raise AssertionError

    monkeypatch.setattr(registry, "by_name", refuse)
    monkeypatch.setattr(nominal, "expand", refuse)
    found = sus.load(next(tmp_path.glob("*.h5")))
    assert str(found).strip() == done.stdout.strip()
    assert len(found.plot().axes) > 3
