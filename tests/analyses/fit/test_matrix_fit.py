"""Matrices from measurement: true ones are found, with the stated uncertainties, and written where
`damp` takes them; what the data cannot give is refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

import suspension_cli as sus
from suspension_cli.analyses.fit import matrix_fit
from suspension_cli.analyses.fit.matrix_fit import OsemData
from suspension_cli.design.control import Osem
from suspension_cli.errors import InputError
from suspension_cli.linear import response, signals
from suspension_cli.measurements.transfer_function import MeasuredResponse
from suspension_cli.models import registry
from suspension_cli.physics.local_control import compute_matrices
from suspension_cli.studies.response_matrix import Plant
from tests.support import scenes
from tests.support.commandline import assert_refused, run, strict_json
from tests.support.golden import ROOT

FOLDER = ROOT / "measured" / "matrices"
DESIGN = FOLDER / "triple.toml"
MEASURED = FOLDER / "measured.toml"
GRID = np.geomspace(0.3, 12.0, 40)
PLACES = {"T": (0.0, 0.0, 0.05), "L": (0.0, 0.1, -0.02), "R": (0.0, -0.1, -0.03)}
OSEMS = tuple(Osem(name=n, stage="upper", at=at, direction="x") for n, at in PLACES.items())
DOFS = ("x", "y", "z", "roll", "pitch", "yaw")
FORCES = ("force_x", "force_y", "force_z", "torque_roll", "torque_pitch", "torque_yaw")
OWN = [0, 4, 5]
"""Motions that three sensors along x resolve."""


@pytest.fixture(scope="module")
def plant():
    return Plant.of(sus.example("double").design, "string")


def exact_responses(design, frequency=GRID):
    """Motions of the upper mass over forces on it, by the solver of `response`."""
    system = registry.STRING.system(design)
    known = signals.bodies_with_signals(system)
    inputs = [signals.parse_input(f"upper.{name}", known) for name in FORCES]
    outputs = [signals.parse_output(f"upper.{name}", known) for name in DOFS]
    return response.solve(system, frequency, inputs, outputs).value


def wrong_rows(random):
    """Rows of sensors or coils whose gains are off by 10 %, places by 2 mm, pitch and yaw alike."""
    rows = np.zeros((3, 6))
    for row, at in zip(rows, PLACES.values(), strict=True):
        _, y, z = np.array(at) + 2e-3 * random.normal(size=3)
        row[OWN] = (1 + 0.1 * random.normal()) * np.array([1.0, z, -y])
    return rows


def simulate(seed, share, responses, delay=1e-3):
    """Random A and B, and data with a relative noise."""
    random = np.random.default_rng(seed)
    a, b = wrong_rows(random), wrong_rows(random).T
    late = np.exp(-2j * np.pi * GRID * delay)[:, None, None]
    value = late * (a @ responses @ b)
    sigma = share * np.abs(value)
    scatter = random.normal(size=(2, *value.shape))
    noisy = value + sigma * (scatter[0] + 1j * scatter[1])
    return a, b, OsemData(OSEMS, OSEMS, GRID, noisy, sigma)


def scales(a):
    """Scales at which the nominal sensing matrix reads the motions, by hand."""
    nominal = np.array([[1.0, z, -y] for _, y, z in PLACES.values()])
    return np.diag(np.linalg.inv(nominal) @ a[:, OWN])


def true_matrices(a, b):
    """S and D in the convention that these scales are 1."""
    scale = scales(a)
    return scale[:, None] * np.linalg.inv(a[:, OWN]), np.linalg.inv(b[OWN]) / scale


def test_true_matrices_are_found_without_noise(plant):
    responses = exact_responses(plant.design)
    for seed in range(3):
        a, b, _ = simulate(seed, 0.0, responses)
        a[:, OWN] /= scales(a)  # all else agrees with the priors, which move nothing then
        late = np.exp(-2j * np.pi * GRID * 1e-3)[:, None, None]
        value = late * (a @ responses @ b)
        data = OsemData(OSEMS, OSEMS, GRID, value, 1e-6 * np.abs(value))
        found = matrix_fit.solve(data, plant).matrices
        assert found.motion == ("x", "pitch", "yaw")
        sensing, driving = true_matrices(a, b)
        np.testing.assert_allclose(found.sensing, sensing, atol=1e-9 * np.abs(sensing).max())
        np.testing.assert_allclose(found.driving, driving, atol=1e-9 * np.abs(driving).max())
        assert found.delay == pytest.approx(1e-3, abs=1e-12)
        coupled = dict(zip(found.pair, found.after.max(0), strict=True))
        assert max(coupled["x, yaw"], coupled["pitch, yaw"]) < 1e-7
        np.testing.assert_allclose(found.after[:, 0], found.suspension[:, 0], rtol=1e-6)


def test_truth_lies_in_the_95_percent_region_so_often(plant):
    """The model has other mode frequencies and losses than the suspension; 2 % noise.

    In 16 trials the region must have the truth 13 times or more (15 expected), and
    95 % of all elements theirs, which are correlated.
    """
    built = sus.example("double").replace(
        {"stage.upper.wires.l": 0.302, "stage.test.wires.d": 0.0011}
    )
    responses = exact_responses(built.design)
    inside, pulls, over_noise = [], [], []
    for seed in range(16):
        a, b, data = simulate(seed, 0.02, responses)
        found = matrix_fit.solve(data, plant)
        record = found.matrices
        sensing, driving = true_matrices(a, b)
        off = np.concatenate(
            [(record.sensing - sensing).ravel(), (record.driving - driving).ravel()]
        )
        pulls.append(np.abs(off) / np.sqrt(np.diag(record.covariance)))
        count = found.problem.parts[1].stop  # unknowns of A and B
        error = (found.z - found.problem.pack(a, b))[:count]
        distance = error @ np.linalg.solve(found.covariance[:count, :count], error)
        inside.append(distance < stats.chi2.ppf(0.95, count))
        assert found.scale == 1.0
        free = [n for n, pair in enumerate(record.pair) if "yaw" in pair]
        over_noise.append(record.median_after[free] / record.median_noise[free])
        assert (record.median_after[free] < record.median_before[free]).all()
    assert sum(inside) >= 13
    assert 0.9 < np.mean(np.array(pulls) < 1.96) <= 1.0
    assert 0.7 < np.mean(over_noise) < 1.3


def test_signs_and_gains_far_from_the_design_are_found(plant):
    a, b, _ = simulate(5, 0.0, exact_responses(plant.design))
    a[1] *= -1.0
    b[:, 2] *= -3.0
    value = a @ exact_responses(plant.design) @ b
    found = matrix_fit.solve(OsemData(OSEMS, OSEMS, GRID, value, 1e-6 * np.abs(value)), plant)
    record = found.matrices
    assert (record.reversed_sensors, record.reversed_coils) == (("L",), ("R",))
    identity = record.sensing @ record.sensing_rows[:, OWN]
    np.testing.assert_allclose(identity, np.eye(3), atol=1e-9)
    ratio = record.sensing_rows[:, OWN] / a[:, OWN]  # the scales alone are a convention
    np.testing.assert_allclose(ratio, np.broadcast_to(ratio[0], ratio.shape), rtol=1e-6)


def test_what_the_data_do_not_determine_is_refused(plant):
    responses = exact_responses(plant.design)
    _, _, data = simulate(1, 0.02, responses)
    noise = OsemData(OSEMS, OSEMS, GRID, data.value, 1e4 * np.abs(data.value))
    with pytest.raises(InputError, match=r"these data do not tell x.* of upper apart"):
        matrix_fit.solve(noise, plant)
    few = OsemData(OSEMS, OSEMS, GRID[:1], data.value[:1], data.sigma[:1])
    with pytest.raises(InputError, match=r"1 frequency gives 18 numbers for .* unknowns"):
        matrix_fit.solve(few, plant)
    above = tuple(Osem(name=n, stage="upper", at=(0, 0, 0), direction=(0, 1, 1)) for n in "ab")
    two = OsemData(above, above, GRID, data.value[:, :2, :2], data.sigma[:, :2, :2])
    with pytest.raises(InputError, match="resolve no motion alone"):
        matrix_fit.solve(two, plant)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"input": "upper.force_x"}, "is not an OSEM"),
        ({"output": "osem.F7"}, r"names no \[\[control.osem\]\] of the design"),
        ({"uncertainty": np.full(3, np.nan)}, "gives no uncertainty"),
        ({"frequency": np.array([1.0, 2.0, 4.0])}, "has other frequencies"),
        ({"output": "osem.F1"}, "gives a sensor and a coil twice"),
        ({}, "lacks osem.F2 over osem.F2"),
    ],
)
def test_functions_that_are_no_matrix_are_refused(change, message):
    design = sus.read(DESIGN).design
    grid = np.array([1.0, 2.0, 3.0])
    whole = {"frequency": grid, "value": grid + 0j, "uncertainty": grid, "coherence": grid}
    pairs = [("F1", "F1"), ("F1", "F2"), ("F2", "F1"), ("F2", "F2")][: 3 if not change else 4]
    functions = [
        MeasuredResponse("a", **({"input": f"osem.{c}", "output": f"osem.{s}"} | whole))
        for c, s in pairs
    ]
    last = {name: getattr(functions[1], name) for name in ("input", "output", *whole)}
    functions[1] = MeasuredResponse("b", **(last | change))
    with pytest.raises(InputError, match=message):
        matrix_fit.collect(design, functions)


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """The example, fitted once."""
    folder = tmp_path_factory.mktemp("fitted")
    done = run("fit", DESIGN, MEASURED, "--matrices", "--json", "--out", folder)
    assert done.exit_code == 0, done.stderr
    return strict_json(done.stdout), folder


def test_the_command_writes_a_design_that_damp_takes(fitted):
    document, folder = fitted
    found = document["matrices"]
    assert found["motions"] == list(DOFS)
    assert found["reversed_coils"] == ["SD"]
    damped = sus.damp(sus.read(folder / "triple-fitted.toml"), fidelity="string")
    [osems] = damped.osems
    np.testing.assert_allclose(osems.to_euler, found["sensing"], rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose(osems.to_coil, found["driving"], rtol=1e-6, atol=1e-7)
    kept = [line for line in (folder / "triple-fitted.toml").read_text().splitlines() if line]
    given = [line for line in DESIGN.read_text().splitlines() if line]
    assert set(given) <= set(kept)
    assert len(kept) == len(given) + 4 + 12  # four comments, two keys of each of six OSEMs
    rows = zip(found["pairs"], *(found[f"median_{name}"] for name in ("before", "after", "noise")),
               strict=True)  # fmt: skip
    for pair, before, after, noise in rows:
        if pair not in ("x, pitch", "y, roll"):  # those of the suspension itself stay
            assert after < 1.5 * noise < 0.3 * before, pair


def test_the_result_is_read_back(fitted):
    document, folder = fitted
    loaded = sus.load(folder / "triple-fit.h5")
    np.testing.assert_array_equal(loaded.matrices.sensing, document["matrices"]["sensing"])
    assert loaded.matrices.covariance.shape == (72, 72)
    assert "CHANNEL: the sign of the coil SD is the opposite" in str(loaded)
    assert loaded.plot() is not None


def test_files_with_other_measurements_are_refused(tmp_path):
    more = tmp_path / "more.toml"
    text = MEASURED.read_text().replace('file = "', f'file = "{FOLDER}/')
    more.write_text(
        text + '\n[[mode]]\nlabel = "test yaw#1"\nfrequency = 0.6\nuncertainty = 0.01\n'
    )
    [line] = assert_refused(run("fit", DESIGN, more, "--matrices", "--out", tmp_path / "o"), more)
    assert line.startswith("mode: is not used with --matrices")


def test_measured_rows_of_osems_replace_those_of_geometry():
    """Rows that are geometry's change nothing; scaled ones scale the matrices."""
    plain = [Osem(name=n, stage="upper", at=at, direction="x") for n, at in PLACES.items()]
    rows = [(1.0, 0.0, 0.0, 0.0, z, -y) for _, y, z in PLACES.values()]
    given = [
        Osem(name=n, stage="upper", at=(0, 0, 0), direction="z", sensing=list(row),
             driving=[2 * one for one in row])
        for n, row in zip(PLACES, rows, strict=True)
    ]  # fmt: skip
    [expected], [found] = compute_matrices(plain), compute_matrices(given)
    assert found.coordinate == expected.coordinate == ("x", "pitch", "yaw")
    np.testing.assert_allclose(found.to_euler, expected.to_euler, rtol=1e-12)
    np.testing.assert_allclose(found.to_coil, expected.to_coil / 2, rtol=1e-12)
    stage = scenes.hung({"count": 4, "l": 0.4, "s": 0.03, "t1": 0.1, "t2": 0.1, "k": 4e4}, 3.0, 0.1)
    none = {"name": "o", "stage": "test", "at": [0, 0, 0], "direction": "x", "sensing": [0.0] * 6}
    loop = {"name": "x", "sensor": "test.x", "actuator": "test.force_x", "damper": 1.0}
    with pytest.raises(InputError, match="is 0 for all motions"):
        scenes.design_of(scenes.raw_of(stage) | {"control": {"loop": [loop], "osem": [none]}})
