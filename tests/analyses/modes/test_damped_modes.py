"""Modes with losses of any size: closed forms, and roots in fifty digits that share nothing with
the program."""

from __future__ import annotations

import json

import mpmath
import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.design.reader import template
from suspension_cli.linear import damped
from suspension_cli.linear.structure import Structure
from suspension_cli.models import registry
from suspension_cli.physics import wire_modes
from tests.support import scenes
from tests.support.commandline import modes_json, run, written
from tests.support.paths import CONFIGS

MP = mpmath.mp.clone()
MP.dps = 50
GRAVITY = 9.81


def pendulum(mass, length, wires, **more):
    return {
        "body": {"mass": mass, "inertia": [0.1] * 3},
        "wires": {"count": 4, "l": length, "s": 0.1, "t1": 0.1, "t2": 0.1, "k": 1e5} | wires,
    } | more


def pair(damping, **wires):
    """20 kg and 2 kg, each on four vertical wires attached at the height of the centres of mass, so
    that x does not couple to pitch."""
    upper = {"name": "top", **pendulum(20.0, 0.5, wires)}
    lower = {"name": "test", **pendulum(2.0, 0.5, wires, damping={"x": damping, "against": "top"})}
    return {"design": {"name": "pair"}, "stage": [upper, lower]}


def single(damping=None, **more):
    return {
        "design": {"name": "single"},
        "stage": [
            {
                "name": "test",
                **pendulum(3.0, 0.7, {}, **({"damping": damping} if damping else {}), **more),
            }
        ],
    }


def solved(raw, level="string"):
    model = registry.by_name(level).system(scenes.design_of(raw))
    return model, damped.solve(model)


def determinant_roots(model, starts, block):
    """Zeros of det(K + s C + s^2 M) of one block near starts, in 50 digits."""
    k, c, m = (
        MP.matrix(matrix[np.ix_(block, block)].tolist())
        for matrix in (model.stiffness, model.damping, model.mass)
    )

    def determinant(s):
        return MP.det(k + s * c + s**2 * m)

    return [
        complex(
            MP.findroot(determinant, MP.mpmathify(complex(s)), tol=1e-60, maxsteps=60, verify=False)
        )
        for s in starts
    ]


def block_of(model, coordinate):
    return next(
        group for group in Structure(model).blocks if model.coordinate.index(coordinate) in group
    )


def on_springs(name="test", mass=3.0, **spring):
    """A stage on springs of its own, which carry it."""
    given = {"stiffness": [42.0, 50.0, 60.0, 3.0, 4.0, 5.0]} | spring
    return {
        "name": name,
        "hangs_from": "support",
        "body": {"mass": mass, "inertia": [0.1] * 3},
        "position": [0, 0, -0.1],
        "spring": [given | {"preload": [0, 0, mass * GRAVITY, 0, 0, 0]}],
    }


@pytest.mark.parametrize("damping", [1e-9, 5.0, 22.0, 23.0, 1e6])
def test_one_damped_oscillator(damping):
    """m s^2 + c s + k = 0 of a body on springs, light to far overdamped: 2 sqrt(k m) is 22.45 N
    s/m."""
    k = 42.0
    stage = on_springs(damping=[damping, 0, 0, 0, 0, 0])
    _, found = solved({"design": {"name": "one"}, "stage": [stage]})
    rate = damping / 6
    if rate**2 < k / 3:
        [n] = np.flatnonzero(found.decay_rate > 0)
        assert found.frequency[n] == pytest.approx(np.sqrt(k / 3) / (2 * np.pi), rel=1e-12)
        assert found.q[n] == pytest.approx(np.sqrt(k / 3 - rate**2) / (2 * rate), rel=1e-11)
        assert len(found.q) == 6
    else:
        assert found.overdamped.tolist() == [True, True] + [False] * 5
        fast = rate + np.sqrt(rate**2 - k / 3)
        assert found.decay_rate[:2] == pytest.approx([k / 3 / fast, fast], rel=1e-11)
        assert np.isnan(found.frequency[:2]).all()
        assert (found.q[:2] == 0).all()
    assert not found.decay_rate[found.frequency > 0][found.q[found.frequency > 0] == np.inf].any()


@pytest.mark.parametrize("angle", [1e-12, 0.1, 0.7])
def test_a_constant_loss_angle(angle):
    """s = i omega_0 sqrt(1 + i phi): Q = 1 / (2 tan(atan(phi) / 2)), 10.025 at phi = 0.1, where
    first order says 10."""
    _, found = solved({"design": {"name": "one"}, "stage": [on_springs(loss_angle=angle)]})
    expected = 1 / (2 * np.tan(np.arctan(angle) / 2))
    if angle == 0.1:
        assert expected == pytest.approx(10.025, abs=5e-4)
    assert found.q == pytest.approx(expected, rel=1e-12)
    still = np.sort(np.sqrt([42 / 3, 50 / 3, 60 / 3, 30, 40, 50])) / (2 * np.pi)
    assert found.frequency == pytest.approx(still * (1 + angle**2) ** 0.25, rel=1e-13)


@pytest.mark.parametrize("detuning", [0.0, 1e-9, 1e-5])
def test_two_modes_closer_than_their_widths(detuning):
    """Two equal bodies on springs that a damper joins to one another: weak damping couples modes
    whose frequencies all but agree."""
    stages = [
        on_springs(name, 1.0, stiffness=[100.0 * (1 + change), 130.0, 160.0, 3.0, 4.0, 5.0])
        for name, change in (("one", 0.0), ("two", detuning))
    ]
    stages[0]["damping"] = {"x": 1e-5}
    stages[1]["damping"] = {"x": 1e-5, "against": "one"}
    model, found = solved({"design": {"name": "twins"}, "stage": stages})
    own = np.flatnonzero(found.decay_rate > 0)
    assert len(own) == 2
    c = np.array([[2e-5, -1e-5], [-1e-5, 1e-5]])
    one, two, c1, c2, c12 = (
        MP.mpf(float(value))
        for value in (model.stiffness[6, 6], model.stiffness[12, 12], c[0, 0], c[1, 1], c[0, 1])
    )
    mp_roots = MP.polyroots(
        [1, c1 + c2, one + two + c1 * c2 - c12**2, one * c2 + two * c1, one * two],
        maxsteps=500,
        extraprec=400,
    )
    expected = sorted(float(-s.real) for s in mp_roots if s.imag > 0)
    assert sorted(found.decay_rate[own]) == pytest.approx(expected, rel=1e-9)


def test_losses_that_depend_on_frequency():
    """A blade of tabulated loss: the root of m s^2 + k (1 + i phi(Im s)) in fifty digits."""
    table = {"frequency": [0.1, 10.0], "angle": [0.01, 0.9]}
    raw = single()
    raw["materials"] = {
        "putty": {
            "youngs_modulus": 1e11,
            "poisson_ratio": 0.3,
            "density": 8000.0,
            "loss": {"table": table},
        }
    }
    raw["stage"][0]["wires"] |= {"material": "putty", "radius": 2e-4}
    del raw["stage"][0]["wires"]["k"]
    model, found = solved(raw, "beam")
    [n] = [n for n, home in enumerate(found.home) if home == ("test", "z")]
    group = block_of(model, "test.z")
    stiffness, mass = model.stiffness[group[0], group[0]], model.mass[group[0], group[0]]
    assert len(group) == 1
    omega = np.sqrt(stiffness / mass)
    for _ in range(200):
        angle = np.exp(
            np.interp(
                np.log(np.clip(omega / (2 * np.pi), 0.1, 10.0)),
                np.log([0.1, 10.0]),
                np.log([0.01, 0.9]),
            )
        )
        s = 1j * np.sqrt(stiffness / mass * (1 + 1j * angle))
        omega = s.imag
    assert found.frequency[n] == pytest.approx(abs(s) / (2 * np.pi), rel=1e-10)
    assert found.q[n] == pytest.approx(s.imag / (-2 * s.real), rel=1e-10)


def test_a_massless_tip_on_a_dashpot():
    """A support structure without mass on a spring and a damper adds a real pole: m s^2 + 1 / (1/k
    + 1/(k_f + s c)) = 0, a cubic."""
    raw = single()
    raw["support"] = {"stiffness": {"z": 5e4}, "damping": {"z": 2e4}}
    _, found = solved(raw)
    k, kf, c, m = 4e5, 5e4, 2e4, 3.0
    roots = np.roots([m * c, m * (kf + k), k * c, k * kf])
    real = next(s.real for s in roots if abs(s.imag) < 1e-9)
    pole = next(s for s in roots if s.imag > 0)
    vertical = [
        n for n, home in enumerate(found.home) if home[1] == "z" and not found.overdamped[n]
    ]
    assert found.decay_rate[found.overdamped] == pytest.approx([-real], rel=1e-6)
    assert found.frequency[vertical] == pytest.approx([abs(pole) / (2 * np.pi)], rel=1e-6)
    assert found.q[vertical] == pytest.approx([pole.imag / (-2 * pole.real)], rel=1e-6)


def test_growth_and_rest_with_dampers():
    """A free rotation with a damper is a rigid mode and a decay at c / I; an inverted pendulum
    grows at the root of the damped equation."""
    free = scenes.hung({"count": 1, "l": 0.7, "k": 1e5, "d": 0.01}, 3.0, 0.1, damping={"yaw": 0.02})
    _, found = solved({"design": {"name": "spin"}, "stage": [free]})
    assert ((found.omega_squared == 0) & ~found.overdamped).sum() == 1
    assert found.decay_rate[found.overdamped] == pytest.approx([0.2], rel=1e-12)
    top = single({"x": 0.5}, spring=[{"stiffness": [-150.0, 0, 0, 0, 0, 0]}])
    model, found = solved(top)
    k, m = model.stiffness, model.mass
    assert not found.stable
    group = block_of(model, "test.x")
    growth = found.growth_rate[0]
    matrix = (
        k[np.ix_(group, group)]
        + growth * model.damping[np.ix_(group, group)]
        + growth**2 * m[np.ix_(group, group)]
    )
    assert np.abs(np.linalg.eigvalsh(matrix)).min() < 1e-12 * growth**2 * m[group[0], group[0]]
    assert growth < np.sqrt(
        np.linalg.eigvalsh(-k[np.ix_(group, group)]).max() / m[group[0], group[0]]
    )
    assert not found.overdamped.any()


@pytest.mark.parametrize(("angle", "highest"), [(0.01, 300.0), (0.1, 60.0)])
def test_cords_of_large_loss(angle, highest):
    """No mode is lost or found twice where violin modes of large loss lie as close as their widths;
    Q is dilution over loss angle."""
    cord = {"material": "cord", "radius": 1.5e-3}
    ends = [[1.0, 0.0], [-0.5, 0.866], [-0.5, -0.866]]
    raw = {
        "design": {"name": "cords"},
        "materials": {
            "cord": {
                "youngs_modulus": 4e9,
                "poisson_ratio": 0.4,
                "density": 1140.0,
                "loss_angle": angle,
                "loss": {"thermoelastic": False},
            }
        },
        "stage": [
            {
                "name": "test",
                "body": {"mass": 0.8, "inertia": [0.002, 0.0025, 0.003]},
                "position": [0.0, 0.0, -1.2],
                "wire": [
                    {"upper": [0.1 * x, 0.1 * y, 0.0], "lower": [0.08 * x, 0.08 * y, 0.02], **cord}
                    for x, y in ends
                ],
            }
        ],
    }
    system = registry.VIOLIN.system(scenes.design_of(raw))
    undamped = wire_modes.solve(system, highest)
    found = wire_modes.solve(system, highest, damping=True)
    assert len(found.q) == len(undamped.q)
    np.testing.assert_allclose(found.frequency, undamped.frequency, rtol=0.3 * angle**2 + 1e-5)
    np.testing.assert_allclose(found.q * angle, undamped.dilution, rtol=0.02)


def test_the_command_lists_overdamped_modes(tmp_path):
    file = written(tmp_path, scenes.plain(pair(30.0)))
    answer = modes_json(file, "--out", tmp_path, "--no-plot")
    over = [mode for mode in answer["modes"] if "decay_rate_per_s" in mode]
    assert [mode["frequency_hz"] for mode in over] == [None, None]
    assert [mode["q"] for mode in over] == [0.0, 0.0]
    assert all(mode["decay_rate_per_s"] > 0 for mode in over)
    assert answer["stable"]
    frequency = [
        mode["frequency_hz"] for mode in answer["modes"] if mode["frequency_hz"] is not None
    ]
    assert frequency == sorted(frequency)
    found = sus.load(tmp_path / "pair-modes.h5")
    assert found.overdamped.sum() == 2
    assert found.decay_rate[found.overdamped].tolist() == [
        mode["decay_rate_per_s"] for mode in over
    ]
    shown = run("modes", file, "--out", tmp_path)
    assert shown.exit_code == 0
    assert shown.stdout.count("overdamped") == 2
    assert "decays at" in shown.stdout


def test_towers_with_too_many_modes_of_wires_neglect_their_mass(tmp_path):
    """KAGRA's beam splitter: its stiff parts vibrate among 44,000 modes of wires."""
    options = ["modes", CONFIGS / "built" / "kagra-bs-2019.toml", "--no-plot", "--out", tmp_path]
    result = run(*options, "--json")
    assert result.exit_code == 0 and "so wire mass is neglected" in result.stderr
    document = json.loads(result.stdout)
    assert document["fidelity"] == "beam"
    assert document["estimated_error"] > 0.1  # a keystone, among modes of its wires
    assert len(document["modes"]) == 66
    refused = run(*options, "--fidelity", "violin", "--max-frequency", "1e6")
    assert refused.exit_code == 2 and "take minutes" in refused.stderr


STAGE = """[[stage]]
name = "s{number}"
body = {{ shape = "box", size = [0.2, 0.2, 0.1], mass = 10.0 }}
[stage.wires]
count = 4
l = 0.4
s = 0.04
t1 = 0.06
t2 = 0.06
d = 0.002
material = "c70steel"
radius = {radius}
"""


def test_tall_chains_neglect_wire_mass_below_a_thousand_modes(tmp_path):
    """Each of a few hundred modes moves 120 wires: all would take minutes."""
    file = tmp_path / "chain.toml"
    stages = [STAGE.format(number=n, radius=2e-4 * (30 - n) ** 0.5) for n in range(30)]
    file.write_text('[design]\nname = "chain"\n' + "\n".join(stages))
    result = run("modes", file, "--json", "--out", tmp_path)
    assert result.exit_code == 0
    assert "more than 121 take minutes, so wire mass is neglected" in result.stderr
    document = json.loads(result.stdout)
    assert document["fidelity"] == "beam"
    assert document["estimated_error"] > 1e-3  # more than the tolerance
    assert len(document["modes"]) == 6 * 30
    few = run("modes", file, "--max-frequency", "0.5", "--json", "--out", tmp_path)
    frequency = np.array([mode["frequency_hz"] for mode in json.loads(few.stdout)["modes"]])
    light = np.array([mode["frequency_hz"] for mode in document["modes"]])
    assert frequency == pytest.approx(light[: len(frequency)], rel=1e-3)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("tower", []),  # bodies move far above the first violin mode
        ("double", ["--tolerance", "1e-8"]),
        # bodies on wires of 10 mm across, whose modes start far from those without mass
        ("double", ["--set", "stage.upper.wires.radius=0.005"]),
    ],
)
def test_modes_of_bodies_alone(name, options, tmp_path):
    """Unless asked for, modes of wires are not listed; those of bodies are as in the list of all,
    which counts modes one by one."""
    design = CONFIGS / f"{name}.toml"
    options = [*options, "--json", "--no-plot", "--out", tmp_path]
    quick = json.loads(run("modes", design, *options).stdout)
    assert quick["fidelity"] == "violin"
    top = 1.001 * max(one["frequency_hz"] for one in quick["modes"])
    result = run("modes", design, "--max-frequency", repr(top), *options)
    places = {"x", "y", "z", "roll", "pitch", "yaw"}
    every = [one for one in json.loads(result.stdout)["modes"] if one["dof"] in places]
    assert len(quick["modes"]) == len(every)
    for one, other in zip(quick["modes"], every, strict=True):
        assert one["dof"] in places
        assert one["frequency_hz"] == pytest.approx(other["frequency_hz"], rel=1e-9)
        assert one["q"] == pytest.approx(other["q"], rel=1e-6)
        assert one["dilution"] == pytest.approx(other["dilution"], rel=1e-3)


def test_wires_with_mass():
    """As wires get lighter, damped modes tend to those of wires without mass; Q and frequency of
    strongly damped ones too."""
    raw = pair(30.0, material="c70steel", radius=2e-4)
    raw["materials"] = {
        "airy": {"youngs_modulus": 2e11, "poisson_ratio": 0.3, "density": 1e-2, "loss_angle": 2e-4}
    }
    for stage in raw["stage"]:
        stage["wires"]["material"] = "airy"
    _, beam = solved(raw, "beam")
    found = wire_modes.solve(registry.VIOLIN.system(scenes.design_of(raw)), 80.0, damping=True)
    assert found.overdamped.sum() == beam.overdamped.sum() == 2
    assert len(found.q) == len(beam.q)
    np.testing.assert_allclose(found.decay_rate, beam.decay_rate, rtol=1e-6)
    np.testing.assert_allclose(found.frequency, beam.frequency, rtol=1e-6)


def test_modes_of_wires_alone(tmp_path):
    """Wires of 0.2 m across: no mode is one of the bodies, so that there is none to draw."""
    (tmp_path / "single.toml").write_text(template("single", "single"))
    wide = ("--set", "stage.test.wires.radius=0.1")
    result = run("modes", tmp_path / "single.toml", *wide, "--out", tmp_path / "out")
    assert result.exit_code == 0, result.stderr
    assert (tmp_path / "out" / "single-test.wires.radius=0.1-modes.h5").exists()


@pytest.mark.parametrize(("seed", "count"), [(11, 2), (5, 1)])
def test_random_chains_with_dampers_in_fifty_digits(seed, count):
    """All poles of blocks with random dampers between stages: each is a root, and there are as many
    as degrees of freedom."""
    rng = np.random.default_rng(seed)
    raw = scenes.chain(rng, count)
    names = ["support", *(stage["name"] for stage in raw["stage"])]
    for stage, against in zip(raw["stage"], names[:count], strict=True):
        stage["damping"] = {dof: float(rng.uniform(0, 60)) for dof in ("x", "z", "yaw")} | {
            "against": against
        }
    model, found = solved(raw)
    poles = np.where(
        found.overdamped,
        -found.decay_rate + 0j,
        -found.decay_rate + 1j * np.sqrt(np.maximum(found.omega_squared - found.decay_rate**2, 0)),
    )
    for number, group in enumerate(Structure(model).blocks):
        own = poles[found.block == number]
        assert (2 * (own.imag > 0) + (own.imag == 0)).sum() == 2 * len(group)
        roots = determinant_roots(model, own[:2], block=group)
        np.testing.assert_allclose(own[:2], roots, rtol=1e-9)
