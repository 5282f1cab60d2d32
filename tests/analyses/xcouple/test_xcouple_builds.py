"""Builds of the batch against builds made one by one: the same numbers, the same failures, whatever
is swept."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from suspension_cli.analyses.xcouple.solve import Sweep
from suspension_cli.design import reader
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.linear import response
from suspension_cli.models import registry
from suspension_cli.studies import builds
from suspension_cli.studies.job import Axis
from tests.support import scenes
from tests.support.couplings import (
    FILE,
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
    job = Sweep(FILE.read_text(), axes, requested)
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
    alone = Sweep(base, (Axis(name, (fine,)), Axis("k", k)), requested, level=level)
    both = Sweep(base, (Axis(name, (bad, fine)), Axis("k", k)), requested, level=level)
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
