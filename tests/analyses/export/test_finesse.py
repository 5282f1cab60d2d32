"""Suspensions as elements of finesse 3, read by the real package."""

from __future__ import annotations

import runpy

import numpy as np
import pytest
from scipy.constants import c

import suspension_cli as sus
from tests.support.commandline import run
from tests.support.paths import CONFIGS

finesse = pytest.importorskip("finesse")
MOTIONS, FORCES = ("x", "pitch", "yaw"), ("force_x", "torque_pitch", "torque_yaw")
NODES = dict(
    zip((*MOTIONS, *FORCES), ("z", "pitch", "yaw", "F_z", "F_pitch", "F_yaw"), strict=True)
)
FREQUENCY = np.geomspace(0.1, 30.0, 40)
POWER, REFLECTION, DETUNING = 5.0, 0.99, -2.0  # W, itm, degrees of phase of etm
WAVELENGTH = 1064e-9


def suspended(add, facing=1, power=0.0):
    """A cavity whose end mirror is suspended."""
    model = finesse.Model()
    model.fsig.f = 1
    model.parse(f"""
        l laser P={power}
        s before laser.p1 itm.p1
        m itm R={REFLECTION} T={1 - REFLECTION}
        s arm itm.p2 etm.p1 L=1
        m etm R=1 T=0 phi={DETUNING}
    """)
    model.add(add("sus", model.etm, facing))
    return model


def responses(model, inputs, outputs, frequency=FREQUENCY):
    from finesse.analysis.actions import FrequencyResponse

    found = model.run(FrequencyResponse(frequency, inputs, outputs))
    return {(o, i): found[o, i] for i in inputs for o in outputs}


@pytest.fixture(scope="module")
def exported():
    design = sus.read(CONFIGS / "triple-damped.toml")
    return sus.export(design, format="finesse")


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("finesse")
    done = run("export", CONFIGS / "triple-damped.toml", "--format", "finesse", "--out", folder)
    assert done.exit_code == 0
    return runpy.run_path(str(folder / "triple-damped-statespace-finesse.py"))["suspend"]


def test_written_module_has_the_responses_of_the_design(exported, written):
    """All motions of the mirror from its forces, those on other bodies, and the support."""
    model, system = suspended(written), exported.system
    names = {f"test.{ours}": f"etm.mech.{theirs}" for ours, theirs in NODES.items()}
    inputs = {name: names.get(name, f"sus.{name}") for name in system.input}
    outputs = {f"test.{dof}": names[f"test.{dof}"] for dof in MOTIONS}
    found = responses(model, list(inputs.values()), list(outputs.values()))
    expected = system.at(FREQUENCY)
    for i, source in enumerate(system.input):
        for out, node in outputs.items():
            own = expected[:, system.output.index(out), i]
            np.testing.assert_allclose(found[node, inputs[source]], own, rtol=1e-9, atol=0)


def test_motions_that_symmetry_separates_are_not_coupled(exported, written):
    """No edge where the state space is exactly 0."""
    system = exported.system
    zero = [(system.output.index("test.x"), system.input.index("support.yaw"))]
    zero.append((system.output.index("test.yaw"), system.input.index("upper.force_x")))
    made = suspended(written).sus
    for o, i in zero:
        assert not system.at(FREQUENCY)[:, o, i].any()
        assert f"edge_{o}_{i}" not in made._registered_connections


def test_function_and_file_agree(exported, written):
    def made(name, mirror, facing):
        return sus.finesse(exported, name, mirror, facing)

    nodes = ["sus.support.x"], ["etm.mech.z"]
    one, other = (responses(suspended(add), *nodes) for add in (made, written))
    np.testing.assert_array_equal(
        one["etm.mech.z", "sus.support.x"], other["etm.mech.z", "sus.support.x"]
    )


def test_facing_turns_motions_along_the_beam(written):
    """A mirror that faces -x moves by -x and -pitch along its own axes; yaw stays."""
    nodes = (
        ["sus.support.x", "sus.support.yaw", "etm.mech.F_z"],
        ["etm.mech.z", "etm.mech.pitch", "etm.mech.yaw"],
    )
    along, against = (responses(suspended(written, facing), *nodes) for facing in (1, -1))
    for out, into, sign in (
        ("z", "sus.support.x", -1),
        ("pitch", "sus.support.x", -1),
        ("yaw", "sus.support.yaw", 1),
        ("z", "etm.mech.F_z", 1),
        ("pitch", "etm.mech.F_z", 1),
    ):
        key = f"etm.mech.{out}", into
        np.testing.assert_allclose(against[key], sign * along[key], rtol=1e-12)
    with pytest.raises(ValueError, match="neither 1 nor -1"):
        suspended(written, 2)


def test_optical_spring(written):
    """A detuned cavity adds the stiffness dF/dx of radiation pressure F = 2 P / c."""
    frequency = np.array([0.3, 1.7, 5.0])
    key = "etm.mech.z", "etm.mech.F_z"
    free, held = (
        responses(suspended(written, power=power), [key[1]], [key[0]], frequency)[key]
        for power in (0.0, POWER)
    )

    def force(x):
        phase = 2 * np.radians(DETUNING) + 4 * np.pi * x / WAVELENGTH
        inside = POWER * (1 - REFLECTION) / abs(1 - np.sqrt(REFLECTION) * np.exp(1j * phase)) ** 2
        return 2 * inside / c

    step = 1e-14
    spring = (force(step) - force(-step)) / (2 * step)
    assert spring == pytest.approx(23.03, rel=1e-3)  # N/m, that of gravity is 60
    np.testing.assert_allclose(1 / held - 1 / free, spring, rtol=1e-5)


def test_signals_that_finesse_lacks_are_refused():
    design = sus.read(CONFIGS / "triple-damped.toml")
    for name in ("test.x@0,0,0.001", "test.z", "test~upper.x"):
        with pytest.raises(sus.InputError, match="is no node of finesse"):
            sus.export(design, format="finesse", outputs=name)


@pytest.mark.parametrize("name", ["nodes", "ports", "name"])
def test_stages_named_like_attributes_of_finesse_are_refused(name):
    """The element would lose its own."""
    text = (CONFIGS / "triple-damped.toml").read_text()
    design = sus.parse(text.replace('"middle"', f'"{name}"').replace('"middle.', f'"{name}.'))
    made = sus.export(design, format="finesse")
    with pytest.raises(ValueError, match=f"finesse has a {name} of its own"):
        suspended(lambda *words: sus.finesse(made, *words))
