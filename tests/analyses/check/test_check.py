"""What `pendsus check` reports of loads, limits, heavy wires, inverted pendulums and filters, by
numbers computed here."""

from __future__ import annotations

import math
import re
import tomllib

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.design import reader
from suspension_cli.design.reader import convert
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import batch_modes, eigenmodes
from suspension_cli.models import registry
from suspension_cli.physics import near_limits, statics
from suspension_cli.scene.scene import stack_scenes
from tests.design.test_parts import TOWER
from tests.support.commandline import run, written
from tests.support.golden import CONFIGS, configs
from tools.stability import geometry
from tools.stability.references import MP, document

G = 9.81


def test_tensions_of_an_imperfect_build_are_those_of_beams():
    """A string between hinges carries what the beam between the clamps carries, but for the
    energy of bending: 1e-5 here. Balanced between the clamps it differed by 0.4 %."""
    raw = tomllib.loads((CONFIGS / "husman2000" / "table2.toml").read_text())
    for stage in raw["stage"]:
        stage["wires"] = {**stage["wires"], "bending": "hinged"}
        del stage["wires"]["clamp"]
    raw["perturbation"] = [{"wire": "test.1", "length_change": -1e-4}]
    design = reader.parse(reader.write_toml(raw))
    beam = registry.scene_model("beam")
    scene = stack_scenes([beam.completed(expand(design), design)])
    _, found = beam.in_equilibrium(scene, design)
    tensions = [load.tension for load in statics.solve(design).wires]
    np.testing.assert_allclose(tensions, found.tension[0], rtol=1e-5)


@pytest.mark.parametrize("config", configs(), ids=lambda path: path.stem)
def test_no_shipped_design_is_near_a_limit(config, tmp_path):
    result = run("modes", config, "--fidelity", "string", "--no-plot", "--out", tmp_path)
    assert result.exit_code == 0
    for word in ("close to unstable", "go slack"):
        assert word not in result.stderr


@pytest.mark.parametrize("above", [2e-5, 8e-5, 2e-4])
def test_reported_height_is_where_it_tips(above):
    d = float(geometry.tipping_height()) + above
    design = convert(document(s=geometry.CLOSE, d=d))
    model = registry.STRING.system(design)
    reported = near_limits.describe_tipping(design, eigenmodes.solve(model))
    assert near_limits.is_far_from_tipping(design, model) == (above > near_limits.TIPPING)
    if above > near_limits.TIPPING:
        assert reported == ""
    else:  # the mode's x goes along a little
        assert reported.startswith("test pitch is close to unstable")
        height = float(re.search(r"the wires ([\d.]+) mm", reported)[1])
        assert height == pytest.approx(1e3 * above, rel=0.05)


@pytest.mark.parametrize("above", [-1e-3, -1e-7, 1e-7, 1e-3])
def test_a_factorisation_tells_what_the_modes_tell(above):
    d = float(geometry.tipping_height()) + above
    model = registry.STRING.system(convert(document(s=geometry.CLOSE, d=d)))
    assert batch_modes.is_clearly_stable(model) == eigenmodes.solve(model).stable == (above > 0)


@pytest.mark.parametrize("config", configs(), ids=lambda path: path.stem)
def test_shipped_designs_without_rigid_modes_are_clearly_stable(config):
    design = reader.read(config).design
    model = registry.most_complete(design, massless=True).system(design)
    all_oscillate = (batch_modes.solve(model).omega_squared > 0).all()
    assert batch_modes.is_clearly_stable(model) == all_oscillate


def longer(left):
    """A stage one of whose wires carries this fraction of its share."""
    change = float(geometry.slack_length() * (1 - MP.mpf(left)))
    return document() | {"perturbation": [{"wire": "test.1", "length_change": change}]}


@pytest.mark.parametrize("left", [0.5, 5e-3, 1e-5])
def test_reported_tension_is_the_one_left(left):
    loads = statics.solve(convert(longer(left)))
    reported = near_limits.find_slackest(loads)
    if left > near_limits.SLACK:
        assert reported == []
    else:
        tension = [wire.tension for wire in loads.wires]
        share = f"{100 * min(tension) * 4 / sum(tension):.2g} % of the mean tension"
        assert share in reported[0].problem


def test_commands_say_it(tmp_path):
    low = written(tmp_path, document(s=geometry.CLOSE, d=float(geometry.tipping_height()) + 2e-5))
    options = ("--fidelity", "string", "--no-plot", "--out", tmp_path)
    result = run("response", low, "--frequency", "1", *options)
    said = "test pitch is close to unstable: attaching the wires 0.02 mm lower makes it unstable"
    assert said in result.stderr
    loose = written(tmp_path, longer(5e-3))
    said = r"wire test\.[14] is about to go slack: it carries 0\.\d+ % of the mean tension of its"
    for words in (("check", loose), ("modes", loose, *options)):
        assert re.search(said, run(*words).stderr)


def test_weight_sag_and_profile_of_heavy_wires():
    found = sus.check(sus.read(CONFIGS / "pulled-fibres.toml"))
    own, [profile] = found.weights, found.statics.profiles
    assert own.included and 0.05 < own.total < 0.07
    load = found.statics.wires[0]
    weight = G * 7800 * math.pi * 350e-6**2 * 0.5
    assert own.ratio == pytest.approx(weight / load.tension, rel=0.05)
    assert own.sag == pytest.approx(weight * 0.04 / (8 * load.tension), rel=0.05)
    assert own.line in str(found)
    assert f"281 places in {profile.sections} uniform sections" in str(found)
    document = found.document()
    assert document["wire_weight"]["total_n"] == own.total
    assert document["profiles"][0]["places"] == 281
    light = sus.check(sus.example("quadruple"))
    assert light.weights.line == "" and "wire_weight" not in light.document()
    assert "filters" not in light.document() and "legs" not in str(light)
    heavy = sus.template("single").replace({"stage.test.body.mass": 0.05})
    assert "constants.wire_weight = true includes" in str(sus.check(heavy))


def test_loads_and_margin_of_legs():
    [legs], load = statics.solve(reader.parse(TOWER)).legs, 402.0 * G
    stiffness = (2 * np.pi * 0.06) ** 2 * 402.0
    np.testing.assert_allclose([legs.load, legs.stiffness], [load, stiffness], rtol=1e-12)
    np.testing.assert_allclose(legs.thrust, [load / 3] * 3, rtol=1e-12)
    # K = (W_tip - W) / L
    np.testing.assert_allclose(legs.critical, load + 0.5 * stiffness, rtol=1e-12)
    np.testing.assert_allclose(legs.tilt, 0.5 + G / (2 * np.pi * 0.06) ** 2, rtol=1e-12)
    np.testing.assert_allclose(legs.frequency, 0.06, rtol=1e-12)


def test_working_point_of_a_filter_and_its_thermal_shift():
    settings = ("load=1000.0", "modulus_slope=-2.5e-4", "thermal_expansion=1e-5")
    settings = tuple(f"stage.ip.filter.{one}" for one in settings)
    [blades] = statics.solve(reader.parse_with_overrides(TOWER, settings)).filters
    k = (2 * np.pi * 0.3) ** 2 * 1000.0 / G
    np.testing.assert_allclose(blades.sag, (102.0 * G - 1000.0) / k, rtol=1e-9)
    np.testing.assert_allclose(blades.thermal_force, -0.23, rtol=1e-12)
    np.testing.assert_allclose(blades.thermal_shift, -0.23 / k, rtol=1e-12)


@pytest.mark.parametrize(
    ("setting", "says"),
    [
        ("inverted_pendulum.frequency=0.01", "is near tipping: its load of 3943.62 N"),
        ("filter.load=1100.0", "mm above its working point: it carries 1000.62 N"),
        ("inverted_pendulum.length=500.0", "is larger than any part of a suspension"),
        ("filter.frequency=300.0", "is too high to isolate from anything"),
    ],
)
def test_a_warning_says_what_and_what_to_do(setting, says, tmp_path):
    result = run("check", written(tmp_path, TOWER), "--set", f"stage.ip.{setting}")
    assert result.exit_code == 0 and says in result.stderr


@pytest.mark.filterwarnings("ignore::suspension_cli.errors.PendsusWarning")
def test_tipping_is_a_finding():
    text = TOWER.replace("frequency = 0.06", "stiffness = 600.0")
    found = sus.check(sus.parse(text))
    assert found.stable is False
    assert any("tips over: its load of 3943.62 N is above" in w.line("") for w in found.warnings)
    assert "filters" in found.document()
    assert found.document()["inverted_pendulums"][0]["frequency_hz"] is None
    assert "tips over at" in str(found)
    assert not sus.modes(sus.parse(text), fidelity="string").stable


def test_requirements_that_no_design_meets_are_faults(tmp_path):
    """A wire cannot push, a fraction not exceed 1, and one quantity not be above 5 and below 2."""
    limits = (
        ("stress test.1", "at_most", -1.0),
        ("top fraction of test pitch", "at_least", 1.5),
        ("lowest pitch", "at_least", 5.0),
        ("lowest pitch", "at_most", 2.0),
        ("test static pitch", "at_most", 1e-3),
        ("test static pitch", "at_least", 1e-2),
        ("test static roll", "at_most", -1e-3),
        ("tension test.1", "at_least", 0.0),
    )
    tables = "".join(
        f'[[requirement]]\nquantity = "{name}"\n{key} = {value}\n' for name, key, value in limits
    )
    file = written(tmp_path, f"{reader.template('single', 'single')}\n{tables}")
    found = run("check", file)
    assert found.exit_code == 2
    lines = found.stderr.strip().splitlines()
    for line, number in zip(lines, (1, 2, 3, 6), strict=True):
        assert f"requirement.{number}.{limits[number - 1][1]} = " in line
    assert "contradicts requirement.4.at_most = 2" in lines[2]


def test_values_that_are_0_say_why(tmp_path):
    """By symmetry, or as a material has no loss; and each value names its model."""
    design = sus.template("single").replace(
        {
            "materials": {"w": {"youngs_modulus": 1e11, "density": 7e3}},
            "stage.test.wires.material": "w",
            "requirement": [
                {"quantity": "thermal test.x:10", "at_most": 1e-18},
                {"quantity": "test.y/support.x:10", "at_most": 1e-3},
                {"quantity": "test static pitch", "at_most": 1e-3},
                {"quantity": "test violin 1", "at_least": 100.0},
            ],
        }
    )
    rows = [line for line in str(sus.check(design)).splitlines() if line.startswith("  met")]
    said = ("0 without loss, or by symmetry", "0 by symmetry", "0 by symmetry or balance", " Hz")
    for row, words in zip(rows, said, strict=True):
        assert words in row
    models = [row.rpartition("  ")[0].split()[-1] for row in rows]
    assert models == ["beam", "beam", "beam", "violin"]


def test_plausible_noise_at_points_is_no_warning():
    noise = [[0.1, 1e-9], [10.0, 1e-10]]
    design = sus.example("triple-damped").replace({"control.loop.x.sensor_noise": noise})
    assert not [one for one in sus.check(design).warnings if "sensor" in one.key]
