"""Sensors that loops read by name: sums of motions, blends, estimators, feed-forward."""

from __future__ import annotations

import numpy as np
import pytest
import tomli_w

import suspension_cli as sus
from suspension_cli.analyses.damp import solve as damp
from suspension_cli.design import foton
from suspension_cli.design.loop_sensors import SensorInput
from suspension_cli.errors import InputError
from suspension_cli.linear import response
from suspension_cli.models import registry
from suspension_cli.physics import closed_loop, local_control, noise_budget
from suspension_cli.physics.closed_loop import build_closed_loop
from suspension_cli.physics.ground import Spectrum
from tests.support import plants, scenes
from tests.support.commandline import run

GRID = np.geomspace(0.07, 40.0, 60)
LEAD = 'zpk([0],[40;40],20.0,"n")'
LOW = 'zpk([],[8;15],1,"n")'
WANTED = 'zpk([],[0.7],0.8,"n")'
MODEL = 'zpk([],[0.1+i*0.6;0.1-i*0.6],0.001,"n")'
SLOW = 'zpk([],[9],1,"n")'

ESTIMATOR = {
    "sensor": [
        {"name": "shadow", "motion": "upper~support.x", "sensor_noise": 1e-10},
        {"name": "platform", "motion": "support.x", "sensor_noise": 3e-12, "response": SLOW},
        {
            "name": "estimate",
            "inputs": [
                {"sensor": "shadow", "filter": LOW},
                {"sensor": "platform", "filter": WANTED, "gain": -0.5},
                {"drive": "length", "filter": MODEL},
            ],
        },
    ],
    "loop": [
        {"name": "length", "sensor": "estimate", "actuator": "upper.force_x", "filter": LEAD},
        {"name": "yaw", "sensor": "upper.yaw", "actuator": "upper.torque_yaw", "damper": 0.01},
    ],
}
BLEND = {
    "sensor": [
        {"name": "low", "motion": "upper~support.x", "sensor_noise": 1e-10},
        {"name": "high", "motion": {"upper.x": 0.5, "upper.x@0,0.1,0": 0.5}, "response": SLOW},
        {
            "name": "blend",
            "blend": True,
            "inputs": [{"sensor": "low", "filter": LOW}, {"sensor": "high", "filter": "rest"}],
        },
    ],
    "loop": [{"name": "x", "sensor": "blend", "actuator": "upper.force_x", "filter": LEAD}],
}
FORWARD = {
    "sensor": [{"name": "platform", "motion": "support.x", "sensor_noise": 1e-11}],
    "loop": [
        {"name": "damping", "sensor": "upper.x", "actuator": "upper.force_x", "damper": 4.0},
        {"name": "forward", "sensor": "platform", "actuator": "upper.force_x", "filter": LOW},
    ],
}
DIGITAL = {
    "sensor": [
        {"name": "shadow", "motion": "upper~support.x"},
        {
            "name": "filtered",
            "inputs": [{"sensor": "shadow", "filter": {"design": LOW, "rate": 256.0}}],
        },
    ],
    "loop": [
        {
            "name": "x",
            "sensor": "filtered",
            "actuator": "upper.force_x",
            "filter": {"design": LEAD, "rate": 256.0},
            "delay": 1e-3,
        }
    ],
}
CASES = {"estimator": ESTIMATOR, "blend": BLEND, "forward": FORWARD}


def plant(control, level="string", **how):
    design = scenes.design_of(plants.raw("triple", **how) | {"control": control})
    return local_control.build_plant(design, registry.by_name(level).system(design))


def opened(closed, inputs, outputs):
    """Responses with the loops open, [frequency][output][input]."""
    model = closed.model
    return response.solve(
        model, GRID, plants.drives(model, *inputs), plants.motions(model, *outputs)
    ).value


def at(text):
    return foton.parse(text).at(GRID)


def test_an_estimator_by_hand():
    """u = -H e with e = F s + P w + M u, s = y + g u where y is moved by the platform."""
    closed = plant(ESTIMATOR, loss=True)
    open_loop = opened(closed, ("support.x", "upper.force_x"), ("upper~support.x", "test.x"))
    (relative, pushed), (moved, push) = np.moveaxis(open_loop, 0, -1)
    wanted = -0.5 * at(WANTED) * at(SLOW)
    known = at(LEAD) * (at(LOW) * relative + wanted)
    u = -known / (1 + at(LEAD) * (at(LOW) * pushed + at(MODEL)))
    model = closed.model
    found = local_control.solve_responses(
        closed, GRID, plants.drives(model, "support.x"), plants.motions(model, "test.x")
    )
    np.testing.assert_allclose(found[:, 0, 0], moved + push * u, rtol=1e-9)


def test_zeros_and_poles_of_an_input_are_those_of_a_foton_string():
    numbers = SensorInput(sensor="a", zeros=[0.0, 2.0], poles=[[0.1, 0.6], 8.0], gain=3.0)
    text = 'zpk([0;2],[0.1+i*0.6;0.1-i*0.6;8],3,"n")'
    np.testing.assert_allclose(numbers.made.at(GRID), at(text), rtol=1e-12)


def test_an_estimator_by_numbers_is_that_by_strings():
    shadow, platform, estimate = ESTIMATOR["sensor"]
    inputs = [
        {"sensor": "shadow", "poles": [8.0, 15.0]},
        {"sensor": "platform", "poles": [0.7], "gain": -0.4},
        {"drive": "length", "poles": [[0.1, 0.6]], "gain": 0.001},
    ]
    numbers = ESTIMATOR | {"sensor": [shadow, platform, estimate | {"inputs": inputs}]}
    found = []
    for control in (ESTIMATOR, numbers):
        closed = plant(control, loss=True)
        drives = plants.drives(closed.model, "support.x")
        outputs = plants.motions(closed.model, "test.x")
        found.append(local_control.solve_responses(closed, GRID, drives, outputs))
    np.testing.assert_allclose(found[1], found[0], rtol=1e-10)


def test_noise_of_an_estimator_by_hand():
    closed = plant(ESTIMATOR, loss=True)
    open_loop = opened(closed, ("upper.force_x",), ("upper~support.x", "test.x"))
    pushed, push = np.moveaxis(open_loop[:, :, 0], 0, -1)
    u = -at(LEAD) / (1 + at(LEAD) * (at(LOW) * pushed + at(MODEL)))
    [output] = plants.motions(closed.model, "test.x")
    found = local_control.solve_sensor_noise(closed, GRID, output)
    names = [one.name for one in closed.sensors]
    shadow = np.abs(push * u * at(LOW)) * 1e-10
    platform = np.abs(push * u * 0.5 * at(WANTED) * at(SLOW)) * 3e-12
    np.testing.assert_allclose(found[:, names.index("shadow")], shadow, rtol=1e-9)
    np.testing.assert_allclose(found[:, names.index("platform")], platform, rtol=1e-9)


def test_a_blend_by_hand():
    """What the rest takes is 1 - F of its sensor, through the response of that."""
    closed = plant(BLEND, loss=True)
    watched = ("upper~support.x", "upper.x", "upper.x@0,0.1,0", "test.x")
    open_loop = opened(closed, ("support.x", "upper.force_x"), watched)
    low, *both, far = np.moveaxis(open_loop, 0, -1)
    high = at(SLOW) * (both[0] + both[1]) / 2
    read = at(LOW) * low + (1 - at(LOW)) * high
    u = -at(LEAD) * read[0] / (1 + at(LEAD) * read[1])
    model = closed.model
    found = local_control.solve_responses(
        closed, GRID, plants.drives(model, "support.x"), plants.motions(model, "test.x")
    )
    np.testing.assert_allclose(found[:, 0, 0], far[0] + far[1] * u, rtol=1e-9)


def test_feed_forward_adds_a_path_and_moves_no_pole():
    closed = plant(FORWARD, loss=True)
    alone = plant({"loop": FORWARD["loop"][:1]}, loss=True)
    model = closed.model
    drives = plants.drives(model, "support.x", "upper.force_x")
    watched = plants.motions(model, "test.x")
    moved, push = local_control.solve_responses(alone, GRID, drives, watched)[:, 0].T
    found = local_control.solve_responses(closed, GRID, drives, watched)[:, 0].T
    np.testing.assert_allclose(found[0], moved - at(LOW) * push, rtol=1e-9)
    np.testing.assert_allclose(found[1], push, rtol=1e-9)
    mine = closed_loop.find_poles(closed)
    before = closed_loop.find_poles(alone)
    of_filter = [name.startswith("loop forward") for name in mine.state]
    np.testing.assert_allclose(
        np.sort_complex(mine.value[~np.array(of_filter)]),
        np.sort_complex(before.value),
        rtol=1e-9,
    )
    expected = -2 * np.pi * np.array([8.0, 15.0])
    np.testing.assert_allclose(mine.value[of_filter], expected, rtol=1e-9)


@pytest.mark.parametrize("name", CASES)
def test_state_space_is_the_direct_solution(name):
    closed = plant(CASES[name])
    inputs = plants.drives(closed.model, "support.x", "support.pitch", "upper.force_x")
    outputs = plants.motions(closed.model, "test.x", "test.yaw", "upper.pitch")
    direct = local_control.solve_responses(closed, GRID, inputs, outputs)
    system = build_closed_loop(closed, inputs, outputs).at(GRID)
    size = np.abs(direct)
    assert (np.abs(system - direct) <= 1e-9 * size + 1e-15 * size.max((0, 1))).all()


@pytest.mark.parametrize("name", CASES)
def test_poles_are_eigenvalues_of_the_state_space(name):
    closed = plant(CASES[name])
    system = build_closed_loop(closed, [], plants.all_motions(closed.model))
    found = closed_loop.find_poles(closed).value
    eigenvalues = np.linalg.eigvals(system.a)
    upper = eigenvalues[eigenvalues.imag > -1e-9 * np.abs(eigenvalues)]
    assert len(found) == len(upper)
    for pole in found:
        assert np.abs(upper - pole).min() < 1e-7 * abs(pole)


@pytest.mark.parametrize("name", [*CASES, "digital"])
def test_poles_are_zeros_of_the_return_difference(name):
    """det(1 + K G) is 0 at poles with all losses, delays and rates."""
    control = (CASES | {"digital": DIGITAL})[name]
    closed = plant(control, loss=True)
    found = closed_loop.find_poles(closed)
    low = (np.imag(found.value) > 0) & (np.abs(found.value) < 2 * np.pi * 10)
    low &= np.real(found.value) < -1e-3 * np.abs(found.value)
    assert low.any()
    for pole in found.value[low]:
        size = 1e-4 * abs(pole) * np.exp(2j * np.pi * (np.arange(64) + 0.5) / 64)
        around = pole + size
        value = np.array([_return_difference(closed, one) for one in around])
        turns = np.angle(value / np.roll(value, 1)).sum() / (2 * np.pi)
        assert round(turns) == 1


def _return_difference(closed, s):
    """det(Z) det(1 + K G) at s, with the losses at Im s."""
    model = closed.model
    pencil = closed.solver.pencil
    there = pencil.at_poles(np.array([s]), "all", np.array([s.imag]))
    matrix = np.zeros((model.size, model.size), dtype=complex)
    for block in closed.solver.blocks:
        own = block.at(there).matrix[:, 6:, 0]
        count = len(block.keep)
        body, tension = own[:count, :count], own[count:, count:]
        stiffness = body
        if tension.size:
            stiffness = body - own[:count, count:] @ np.linalg.solve(tension, own[count:, :count])
        matrix[np.ix_(block.keep, block.keep)] = stiffness
    free = np.arange(6, model.size)
    for row, form in zip(
        closed.network.controllers(np.array([s / (2j * np.pi)]))[0], closed.pushed, strict=True
    ):
        matrix = matrix + np.outer(form, row @ closed.sensed)
    sign, _ = np.linalg.slogdet(matrix[np.ix_(free, free)])
    return sign


@pytest.mark.parametrize("how", ["file", "points"])
def test_noise_of_a_sensor_by_file_or_points(how, tmp_path):
    """As that of loops, without a warning that frequencies are no noise."""
    (tmp_path / "noise.csv").write_text("frequency (Hz),noise (nm/sqrt(Hz))\n1,2\n100,2\n")
    noise = {"file": "noise.csv", "points": [[1.0, 2e-9], [100.0, 2e-9]]}[how]
    sensor = {"name": "shadow", "motion": "upper~support.x", "sensor_noise": noise}
    loop = {"name": "x", "sensor": "shadow", "actuator": "upper.force_x", "filter": LEAD}
    raw = plants.raw("triple") | {"control": {"sensor": [sensor], "loop": [loop]}}
    file = tmp_path / "design.toml"
    file.write_text(tomli_w.dumps(raw))
    design = sus.read(file)
    closed = local_control.build_plant(design.design, registry.STRING.system(design.design))
    found = local_control.evaluate_noise(closed.channels[0], np.array([3.0]))
    np.testing.assert_allclose(found, [2e-9], rtol=1e-9)
    assert "sensor_noise" not in run("check", file).stderr


def test_noise_of_one_sensor_is_coherent_in_two_loops():
    """Two loops that read one sensor are as one loop with both gains."""
    shadow = {"name": "shadow", "motion": "upper~support.x", "sensor_noise": 1e-10}
    halves = [
        {"name": name, "sensor": "shadow", "actuator": "upper.force_x", "filter": LEAD}
        for name in ("one", "two")
    ]
    whole = dict(halves[0], filter=f"{LEAD} gain(2)")
    noise = []
    for loops in (halves, [whole]):
        closed = plant({"sensor": [shadow], "loop": loops})
        [output] = plants.motions(closed.model, "test.x")
        noise.append(local_control.solve_sensor_noise(closed, GRID, output)[:, 0])
    np.testing.assert_allclose(noise[0], noise[1], rtol=1e-9)


def test_a_budget_knows_that_the_platform_is_what_its_sensor_reads():
    """Ground and reading are one motion: with the right path they cancel at the actuator."""
    closed = plant(FORWARD, loss=True)
    model = closed.model
    spectrum = Spectrum("flat", np.array([0.01, 100.0]), np.array([1e-9, 1e-9]))
    noises = noise_budget.Noises(closed, plants.motions(model, "test.x"), {"x": spectrum}, None)
    moved, push = local_control.solve_responses(
        plant({"loop": FORWARD["loop"][:1]}, loss=True),
        GRID,
        plants.drives(model, "support.x", "upper.force_x"),
        plants.motions(model, "test.x"),
    )[:, 0].T
    number = noises.cause.index("ground.x")
    expected = np.abs(moved - at(LOW) * push) * 1e-9
    np.testing.assert_allclose(noises.density(GRID)[0, number], expected**2, rtol=1e-9)
    assert noises.cause == ("ground.x", "sensor.platform")


def test_margins_of_a_loop_whose_force_is_read_back():
    """With e = s + M u the command is -H s / (1 + H M): the loop gain is H G / (1 + H M)."""
    closed = plant(ESTIMATOR, loss=True)
    open_loop = opened(closed, ("upper.force_x",), ("upper~support.x",))[:, 0, 0]
    expected = at(LEAD) * at(LOW) * open_loop / (1 + at(LEAD) * at(MODEL))
    found = local_control.compute_loop_gains(closed, GRID)[:, 0]
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_damp_of_an_estimator():
    design = scenes.design_of(plants.raw("triple", loss=True) | {"control": ESTIMATOR})
    model = registry.STRING.system(design)
    found = damp.solve(design, model, "test.x", "test.force_x", GRID, 1.0, samples=3)
    assert found.loop == ("length", "yaw")
    assert found.sensor == ("shadow", "platform", "yaw")
    assert found.margin is not None
    assert found.margin[0].phase > 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"sensor": "upper.force_x"}, "is not a motion of a stage"),
        ({"sensor": "nothing"}, "names a body|names no body"),
        ({"sensor_noise": 1e-9}, "conflicts with the sensor estimate"),
        ({"damper": 3.0, "filter": None}, "does not read motions as they are"),
    ],
)
def test_loops_that_cannot_read_a_sensor(change, message):
    loop = {key: value for key, value in (ESTIMATOR["loop"][0] | change).items() if value}
    with pytest.raises(InputError, match=message):
        plant(ESTIMATOR | {"loop": [loop]})


@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        ([{"sensor": "shdow", "filter": LOW}], "did you mean 'shadow'"),
        ([{"drive": "lenght", "filter": LOW}], "did you mean 'length'"),
        ([{"sensor": "estimate", "filter": LOW}], "reads itself"),
        ([{"sensor": "shadow", "filter": 'zpk([0;0],[1],1,"n")'}], "more zeros"),
        ([{"sensor": "shadow", "filter": "rest"}], "for one input of a blend"),
        ([{"filter": LOW}], "give exactly one: sensor or drive"),
        ([{"sensor": "shadow", "zeros": [1.0]}], "more zeros"),
        ([{"sensor": "shadow", "filter": LOW, "poles": [3.0]}], "conflicts with filter"),
    ],
)
def test_computed_sensors_that_make_no_sense(inputs, message):
    sensors = [*ESTIMATOR["sensor"][:2], {"name": "estimate", "inputs": inputs}]
    with pytest.raises(InputError, match=message):
        plant(ESTIMATOR | {"sensor": sensors})


def test_a_blend_that_does_not_sum_to_one():
    """1 / (1 + i f / 2) + (i f / 3) / (1 + i f / 3) is off by (f / 2 - f / 3) / ... at most."""
    inputs = [
        {"sensor": "low", "filter": 'zpk([],[2],1,"n")'},
        {"sensor": "high", "filter": 'zpk([0],[3],0.333333333333,"n")'},
    ]
    sensors = [
        {"name": "low", "motion": "upper~support.x"},
        {"name": "high", "motion": "upper.x"},
        {"name": "blend", "blend": True, "inputs": inputs},
    ]
    f = np.geomspace(1e-3, 1e3, 20001)
    off = np.abs(1 / (1 + 1j * f / 2) + 1j * f / 3 / (1 + 1j * f / 3) - 1).max()
    with pytest.raises(InputError, match=f"sum to 1 only within {off:.3g}"):
        plant(BLEND | {"sensor": sensors})


@pytest.mark.parametrize(
    ("low", "high", "hidden"),
    [
        ('zpk([],[0.3],1,"n")', f'zpk([0],[0.3],{1 / 0.3!r},"n")', [0.3]),
        ('zpk([],[0.1;1.0],1,"n")', 'zpk([0;1.1],[0.1;1.0],11,"n")', [0.1, 1.0]),
        (
            'zpk([],[0.3+i*0.2;0.3-i*0.2],1,"n")',
            f'zpk([0;0.6],[0.3+i*0.2;0.3-i*0.2],{0.6 / 0.13!r},"n")',
            [0.3 + 0.2j],
        ),
    ],
)
def test_both_filters_of_a_blend_may_be_written_out(low, high, hidden):
    """Their poles coincide and move nothing: others are those of one sensor without filters."""
    motions = [{"name": name, "motion": "upper.x"} for name in ("one", "other")]
    halves = [{"sensor": "one", "filter": low}, {"sensor": "other", "filter": high}]
    loop = {"name": "x", "actuator": "upper.force_x", "filter": LEAD}
    blend = {"name": "both", "blend": True, "inputs": halves}
    control = {"sensor": [*motions, blend], "loop": [{**loop, "sensor": "both"}]}
    plain = {"loop": [{**loop, "sensor": "upper.x"}]}
    found = closed_loop.find_poles(plant(control, loss=True))
    plain_poles = closed_loop.find_poles(plant(plain, loss=True)).value
    expected = np.append(plain_poles, [-2 * np.pi * one for one in 2 * hidden])
    order = np.argsort(np.abs(expected))
    assert np.sort(np.abs(found.value)) == pytest.approx(np.abs(expected)[order], rel=1e-6)


@pytest.mark.parametrize("count", [2, 3])
def test_equal_real_poles_of_feed_forward_stay_where_they_are(count):
    """Nothing moves them, and rounding would make triple ones a pair that oscillates."""
    poles = ";".join(["20"] * count)
    forward = {"sensor": "platform", "actuator": "upper.force_x"}
    text = f'zpk([0],[{poles}],30,"n")'
    control = {
        "sensor": [{"name": "platform", "motion": "support.x"}],
        "loop": [{"name": "x", **forward, "filter": text}],
    }
    found = closed_loop.find_poles(plant(control, loss=True)).value
    near = found[np.abs(np.abs(found) / (40 * np.pi) - 1) < 1e-3]
    assert near == pytest.approx([-40 * np.pi] * count, rel=1e-6)
    assert not np.imag(near).any()
