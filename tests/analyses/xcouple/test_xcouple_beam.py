"""Builds of the batch against builds made one by one, on every model: the same numbers, the same
failures, whatever is swept; finite elements, mirrors and turns."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from suspension_cli.analyses.xcouple import imperfect_builds
from suspension_cli.analyses.xcouple.imperfect_builds import ImperfectBuilds
from suspension_cli.design import reader
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import response, signals
from suspension_cli.models import registry
from suspension_cli.studies import builds
from suspension_cli.studies.job import Axis
from tests.support import finite_elements, lossy, scenes
from tests.support.commandline import edited
from tests.support.couplings import (
    FIGURE_6,
    FILE,
    TRIPLE_FILE,
    answers,
    exact,
    question,
)

AXES = ("", "_y", "_z")


def one_by_one(raw, requested, level="string"):
    """Over and under (f,) of one design by way of its file."""
    model = registry.by_name(level).system(scenes.design_of(raw))
    ends = [requested.input], [requested.over, requested.under]
    return response.solve(model, np.array(requested.frequency), *ends).value[:, :, 0].T


def random_builds(rng, count):
    """Deviations large enough that some builds fail."""
    result = {"k": rng.uniform(0.8, 1.25, count), "length": rng.uniform(-1e-4, 1e-4, count)}
    for stem, size in (("offset", 1e-3), ("lower_offset", 1e-3), ("com", 5e-4)):
        result |= {stem + axis: rng.uniform(-size, size, count) for axis in AXES}
    return result


def perturbed(raw, wire, hold, build):
    """The design file of one build."""
    item = {
        "wire": wire,
        "hold": hold,
        "k_factor": float(build["k"]),
        "length_change": float(build["length"]),
    }
    item |= {
        key: [float(build[stem + axis]) for axis in AXES]
        for key, stem in (("upper_offset", "offset"), ("lower_offset", "lower_offset"))
    }
    return raw | {
        "perturbation": [
            item,
            {
                "body": wire.split(".")[0],
                "com_offset": [float(build["com" + axis]) for axis in AXES],
            },
        ]
    }


def test_mass_and_inertia():
    """Against 60 digits: a heavier body sinks, and the wires that were made for another load carry
    it."""
    k, mass, inertia = 1.1, np.array([0.9, 1.0, 1.1]), np.array([1.05, 0.9, 1.2])
    found = answers(
        {
            "k": np.full(3, k),
            "mass": mass,
            "inertia": inertia,
            "com": np.full(3, 1e-4),
            "offset_y": np.full(3, 2e-4),
        }
    )["ratio"][:, 0].real
    for n in range(3):
        expected = exact(
            {"k": k, "mass": mass[n], "inertia": inertia[n], "com": 1e-4, "offset_y": 2e-4}
        )
        assert found[n] == pytest.approx(expected, rel=1e-11)


PATHS = {
    "geometry": {"stage.test.wires.s": (0.004, 0.005, 0.01)},
    "two lengths": {
        "stage.test.wires.l": (0.25, 0.28),
        "stage.test.wires.d": (0.001, 0.002, 0.003),
    },
    "gravity": {"constants.gravity": (9.0, 9.81)},
    "loss": {"materials.fused-silica.loss_angle": (0.0, 1e-4, 1e-3)},
    "damper": {"stage.test.damping.x": (0.0, 1.0, 10.0)},
    "support": {"support.stiffness.x": (1e4, 1e6), "support.stiffness.pitch": (1e3, 1e5)},
}


@pytest.mark.parametrize("kind", PATHS)
def test_dotted_paths(kind):
    """Every combination is what the design with these values gives, whichever builds are computed
    together."""
    axes = (
        *(Axis(path, values) for path, values in PATHS[kind].items()),
        Axis("k", (0.9, 1.0, 1.1)),
    )
    requested = question(frequency=(3.0, 50.0))
    job = ImperfectBuilds(FILE.read_text(), axes, requested)
    found = job.compute(0, job.count)
    for n, chosen in enumerate(np.ndindex(job.shape)):
        value = {axis.name: axis.values[i] for axis, i in zip(axes, chosen, strict=True)}
        raw = tomllib.loads(FILE.read_text())
        reader.apply_overrides(raw, tuple(f"{path}={value[path]!r}" for path in PATHS[kind]))
        over, under = one_by_one(
            raw | {"perturbation": [{"wire": "test.1", "k_factor": value["k"]}]}, requested
        )
        np.testing.assert_allclose(found["under"][n], under, rtol=1e-12)
        ratio = over / under
        assert np.abs(found["ratio"][n] - ratio).max() < 1e-12 * max(1e-3, np.abs(ratio).max())
        alone = job.compute(n, n + 1)
        assert all(alone[name].tobytes() == found[name][n : n + 1].tobytes() for name in found)
    distinct = {
        round(float(np.abs(size)), 15) for size in found["under"][:, 0] + found["ratio"][:, 0]
    }
    assert len(distinct) > job.count // 3  # what is swept matters


FAILING = {
    "a slack wire": ({"length": [0.0, 5e-3]}, builds.SLACK),
    "its neighbour slack": ({"length": [0.0, -5e-3]}, builds.SLACK),
    "no equilibrium": ({"mass": [1.0, 1e4]}, builds.UNBALANCED),
    "unstable": ({"com_z": [0.0, 0.05]}, builds.UNSTABLE),
    "impossible": ({"stage.test.wires.t1": [0.0965, 0.0]}, builds.IMPOSSIBLE),
}


@pytest.mark.parametrize(
    ("kind", "level"),
    [*((kind, "string") for kind in FAILING), ("a slack wire", "beam"), ("unstable", "violin")],
)
def test_a_failed_build_does_not_touch_the_others(kind, level, monkeypatch):
    # what hangs nowhere is given up early
    monkeypatch.setattr(equilibrium, "STEPS", equilibrium.STEPS[:1])
    values, status = FAILING[kind]
    ((name, (fine, bad)),) = values.items()
    base = (
        FILE.read_text()
        if kind != "impossible"
        else FILE.read_text().replace("l = 0.28 ", "l = 0.05 ")
    )
    k = (0.9, 1.1, 1.2)
    requested = question(frequency=(20.0, 50.0))
    alone = ImperfectBuilds(base, (Axis(name, (fine,)), Axis("k", k)), requested, level=level)
    both = ImperfectBuilds(base, (Axis(name, (bad, fine)), Axis("k", k)), requested, level=level)
    one, two = alone.compute(0, 3), both.compute(0, 6)
    assert (two["status"][:3] == status).all()
    assert not two["status"][3:].any()
    for name, found in two.items():
        assert found[3:].tobytes() == one[name].tobytes()
        if found.dtype.kind == "c":
            assert np.isnan(found[:3].real).all()
            assert np.isnan(found[:3].imag).all()
    slack = two["slack_wire"][:3]
    if status == builds.SLACK:
        assert (slack == (0 if bad > 0 else 1)).all()
    else:
        assert (slack == -1).all()


LEVELS = ("beam", "violin")
BY_TURNS = ("string", *LEVELS)
on_both = pytest.mark.parametrize("level", LEVELS)


KINDS = {
    "triple": lambda: tomllib.loads(TRIPLE_FILE.read_text()),
    "quadruple": lambda: lossy.raw("quadruple"),
    "silica": lambda: lossy.raw("silica"),
    "five": lambda: lossy.raw("five"),
    "around": lambda: lossy.raw("around"),
    "bladed": lambda: scenes.fibred(
        scenes.bladed_chain(np.random.default_rng(3), 2, tip_mass=True, lateral=True), ribbons=True
    ),
}


@pytest.mark.parametrize("kind", KINDS)
def test_what_a_file_of_each_build_gives(kind):
    """Losses, gas, dampers, springs, a frame, blades, ribbons, tapers, clamps at bending points:
    all imperfections at once, from far below to violin modes.

    One length is held or the other, on one model or the other, by turns.
    """
    number = list(KINDS).index(kind)
    level, hold = BY_TURNS[number % 3], ("loaded-length", "natural-length")[number // 2 % 2]
    raw = KINDS[kind]()
    design = scenes.design_of(raw)
    wire = f"{design.stage[-1].name}.1"
    requested = question(design, wire, hold, frequency=(0.05, 7.0, 50.0, 777.0))
    values = {
        name: 1 + (value - 1) / 4 if name == "k" else value / 4
        for name, value in random_builds(np.random.default_rng([61, *map(ord, kind)]), 2).items()
    }
    found = answers(values, requested, design, level)
    assert (found["status"] == builds.GOOD).all()
    for n in (len(kind) % 2,):  # one of them alone
        over, under = one_by_one(
            perturbed(raw, wire, hold, {name: value[n] for name, value in values.items()}),
            requested,
            level,
        )
        assert (np.abs(found["over"][n] - over) < 1e-9 * np.abs(over) + 2e-12 * np.abs(under)).all()
        assert (np.abs(found["under"][n] - under) < 1e-11 * np.abs(under)).all()


@pytest.mark.parametrize("frequency", [50.0, 2000.0])
def test_against_finite_elements(frequency):
    """One wire stiffer by 30 %, trimmed: the stage hangs as drawn, so that each wire can be cut
    into 40 elements, and those solved for x over z."""
    raw = edited(
        tomllib.loads(FILE.read_text()),
        {("materials", "fused-silica"): {"loss": {"angle": 0.0, "thermoelastic": False}}},
    )
    design = scenes.design_of(raw)
    requested = question(design, frequency=(frequency,))
    found = answers({"k": [1.3]}, requested, design, "violin")
    scene = finite_elements.with_fibres(expand(design), design)
    first, *others = scene.fibres.wire
    first = replace(
        first, sections=tuple(replace(s, stretching=1.3 * s.stretching) for s in first.sections)
    )
    stiffness, mass = finite_elements.matrices(
        replace(scene, fibres=replace(scene.fibres, wire=(first, *others))), 40
    )
    dynamic = stiffness - (2 * np.pi * frequency) ** 2 * mass
    motion = np.linalg.solve(dynamic[6:, 6:], -dynamic[6:, 2])
    x, z = motion[0] - 0.001 * motion[4], motion[2]
    assert found["under"][0, 0] == pytest.approx(z, rel=2e-4)
    assert found["over"][0, 0] == pytest.approx(x, rel=2e-4)


@pytest.mark.parametrize("name", ["k", "lower_offset", "length", "com"])
def test_a_tiny_coupling_is_in_proportion_down_to_its_last_digits(name):
    """Over five decades; the slope is what builds with imperfections a million times larger give,
    from either side of none."""

    def ratios(steps):
        values = {name: 1 + steps if name == "k" else 1e-3 * steps}
        return answers(values, question(), FIGURE_6, "violin")["ratio"][:, 0].real

    assert ratios(np.zeros(1))[0] == 0
    step = np.geomspace(1e-10, 1e-5, 11)
    slope = ratios(step) / ((1 + step) - 1 if name == "k" else step)
    h = np.array([1e-3, -1e-3, 5e-4, -5e-4])
    large = ratios(h)
    rough, fine = (large[0] - large[1]) / 2e-3, (large[2] - large[3]) / 1e-3
    error = np.abs(slope / (fine + (fine - rough) / 3) - 1)
    assert error.max() < 2e-4  # an offset of 1e-13 m
    assert error[1:].max() < 1e-4


UNEVEN = {
    "clamp": {"clamp": {"upper": [0.1, 0.0, -1.0]}},
    "radius": {"radius": 4e-4},
    "temperature": {"temperature": 350.0},
}


def four_wires(change):
    """A stage on four wires of one k; what two of them have more."""
    wires = []
    for along, across in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        end = [0.02 * along, 0.1 * across, 0.0]
        wires.append(
            {"upper": end, "lower": end, "material": "steel302", "radius": 2e-4, "k": 4e4}
            | (change if along > 0 else {})
        )
    body = {"mass": 10.0, "inertia": [0.1, 0.1, 0.1]}
    return scenes.raw_of(
        {"name": "test", "body": body, "position": [0.0, 0.0, -0.5], "wire": wires},
        gas={"pressure": 10.0, "molar_mass": 0.029},
    )


@on_both
@pytest.mark.parametrize("kind", UNEVEN)
def test_wires_that_bend_otherwise_are_no_mirror_images(kind, level):
    """On strings y and yaw do not couple; clamps, thickness or warmth of the wires on one side make
    them."""
    design = scenes.design_of(four_wires(UNEVEN[kind]))
    known = ("support", "test")
    outputs = [signals.parse_output("test.yaw", known), signals.parse_output("test.z", known)]
    drive = [signals.parse_input("support.y", known)]
    single, string = (
        response.solve(
            registry.by_name(model).system(design), np.array([2.0, 30.0]), drive, outputs
        ).value[:, :, 0]
        for model in (level, "string")
    )
    assert (string == 0).all()
    assert (np.abs(single[:, 0]) > (1e-12 if kind == "temperature" else 1e-8)).all()
    assert (single[:, 1] == 0).all()  # the mirror in y is left
    found = builds.balance(
        imperfect_builds.impose(expand(design), {"k": np.ones(1)}, question(design)),
        design,
        level=level,
    )
    assert [found.is_symmetric_in(axis).tolist() for axis in (0, 1)] == [[False], [True]]
    batch = builds.transfer(found, np.array([2.0, 30.0]), drive, outputs)[0, :, :, 0]
    np.testing.assert_allclose(batch, single, rtol=1e-6 if kind == "temperature" else 1e-9)
