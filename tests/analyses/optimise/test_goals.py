"""Goals of `pendsus optimise`: closed forms, objectives, short forms, requirements of designs."""

from __future__ import annotations

import math

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.named_quantities import names_of
from suspension_cli.analyses.optimise import solve as searching
from suspension_cli.analyses.optimise import targets
from suspension_cli.design.goals import Free, Goal, Goals, Objective, QuantityRequirement
from suspension_cli.design.schema import Perturbation
from suspension_cli.errors import InputError
from suspension_cli.studies import parameters
from tests.support.commandline import assert_refused, run
from tests.support.exchanging import SMALL
from tests.support.optima import VERTICAL, WIRES, G, free
from tests.support.printed_quantities import EXAMPLES

DOUBLE = sus.example("double").text
MINIMISED = {"test static pitch", "distance test pitch, lowest yaw", "decay of test longitudinal"}
"""Quantities with a sign, that vanish in some designs, and of each design alone."""


@pytest.mark.parametrize("name", sorted(MINIMISED))
def test_an_objective_is_least_at_a_bound(name):
    """All are monotonic in the number: the optimum is at the one of its bounds that is better."""
    [example] = [one for one in EXAMPLES if one.name == name]
    path, value = example.number
    design = sus.parse(example.text)
    bounds = sorted([float(parameters.value_of(design.design, path)), value])
    number = Free(name=path, lower=bounds[0], upper=bounds[1])
    goals = Goals(free=[number], objective=[Objective(minimise=name)])
    found = searching.solve(design, goals, level=example.fidelity)
    ends = [abs(example.printed(design.replace({path: end}))) for end in bounds]
    assert abs(found.quantities.after[0]) == pytest.approx(min(ends), rel=example.accuracy)
    assert found.numbers.after[0] == pytest.approx(bounds[int(np.argmin(ends))], rel=1e-6)


def pendulum(numbers: list[Free], text: str | None = None, **goals):
    """Optimise numbers of a pendulum on vertical wires, or of another design, on strings."""
    design = sus.parse(text or VERTICAL.read_text())
    return searching.solve(design, Goals(free=numbers, **goals), level="string")


def test_a_frequency_gives_the_length_of_a_pendulum():
    """f = sqrt(g/l) / 2 pi, but for the pitch of the body: l = g / omega^2."""
    hertz = 0.8
    wanted = [QuantityRequirement(quantity="test transverse", equals=hertz)]
    found = pendulum([free("l", 0.1, 1.0)], requirement=wanted)
    assert found.numbers.after[0] == pytest.approx(G / (2 * np.pi * hertz) ** 2, rel=1e-9)
    assert found.met


def test_a_static_angle_gives_the_height_of_the_wires():
    """Wires end d above a centre of mass that is displaced by c: tan(pitch) = c / d."""
    displaced = f'{SMALL}\n[[perturbation]]\nbody = "test"\ncom_offset = [1e-4, 0.0, 0.0]\n'
    largest = 0.04
    for limits in ({"at_most": largest}, {"at_least": -largest, "at_most": largest}):
        wanted = [QuantityRequirement(quantity="test static pitch", **limits)]
        found = pendulum([free("d", 1e-3, 5e-3)], displaced, requirement=wanted)
        assert abs(found.quantities.before[0]) == pytest.approx(math.atan(1e-4 / 2e-3), rel=1e-6)
        assert found.numbers.after[0] == pytest.approx(1e-4 / math.tan(largest), rel=1e-5)
        assert found.met
    assert "|" not in found.limits.name[0]


def test_a_limit_on_a_magnitude_counts_beside_one_on_the_signed_value():
    """The larger band allows angles to -0.1, the magnitude only to -0.04."""
    displaced = f'{SMALL}\n[[perturbation]]\nbody = "test"\ncom_offset = [-1e-4, 0.0, 0.0]\n'
    largest = 0.04
    wanted = [
        QuantityRequirement(quantity="test static pitch", at_least=-0.1, at_most=largest),
        QuantityRequirement(quantity="test static pitch", at_most=largest),
    ]
    found = pendulum([free("d", 1e-3, 5e-3)], displaced, requirement=wanted)
    assert found.quantities.before[0] < -largest
    assert len(found.limits.name) == 3
    assert found.numbers.after[0] == pytest.approx(1e-4 / math.tan(largest), rel=1e-5)
    assert found.met


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("limits", [{"at_most": 0.0}, {"equals": 0.0}])
def test_a_limit_of_0_is_one_on_the_value(limits):
    """Wires that end at the centre of mass turn it by nothing that a symmetry forbids."""
    wanted = [QuantityRequirement(quantity="test static pitch", **limits)]
    found = pendulum([free("l", 0.1, 1.0)], requirement=wanted)
    assert found.met
    assert found.limits.room.tolist() == [0.0]


def test_margins_are_those_of_check():
    """Of a design that meets one requirement and misses the other."""
    limits = {"test transverse": {"at_most": 0.8}, "test height": {"at_least": 0.1, "at_most": 0.9}}
    tables = [
        f'\n[[requirement]]\nquantity = "{name}"\n'
        + "".join(f"{side} = {limit}\n" for side, limit in each.items())
        for name, each in limits.items()
    ]
    design = sus.parse(VERTICAL.read_text() + "".join(tables))
    found = searching.solve(design, Goals(free=[free("l", 0.1, 1.0)]), level="beam")
    checked = [verdict.margin for verdict in sus.check(design).verdicts]
    room = found.limits.room_before
    nearest = [room[found.limits.quantity == n].min() for n in range(len(limits))]
    assert checked[0] < 0 < checked[1]
    np.testing.assert_allclose(nearest, checked, rtol=1e-6)


def test_a_short_form_and_a_requirement_mean_the_same():
    numbers = [free("l", 0.1, 1.0), free("s", 0.01, 0.05)]
    short = [
        Goal(kind="band", dof=["yaw"], at_least=2.0),
        Goal(kind="stress", wires=["test"], at_most=0.9),
        Goal(kind="isolation", response="test.x/support.x:10", at_most=5e-3),
        Goal(kind="height", at_most=0.4),
    ]
    long = [
        QuantityRequirement(quantity="yaw 1", at_least=2.0),
        QuantityRequirement(quantity="stress fraction test wires", at_most=0.9),
        QuantityRequirement(quantity="test.x/support.x:10", at_most=5e-3),
        QuantityRequirement(quantity="test height", at_most=0.4),
    ]
    one = pendulum(numbers, goal=short)
    other = pendulum(numbers, requirement=long)
    assert one.limits.name == other.limits.name
    np.testing.assert_array_equal(one.numbers.after, other.numbers.after)
    np.testing.assert_array_equal(one.limits.value, other.limits.value)


REQUIRED = '\n[[requirement]]\nquantity = "test transverse"\nat_most = 0.8\nnote = "soft"\n'


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("sapphire-fibres", {}),  # temperatures from [heat]
        ("triple-tolerance", {"stage.upper.locked": True}),  # whose scatter is left out
        ("tower", {}),  # keystones
    ],
)
def test_imperfections_of_a_goal_are_those_of_the_file(name, changes):
    """What the file leaves to be computed is no fault of it, and is computed with them."""
    design = sus.example(name).replace(changes)
    mirror = design.design.stage[-1].name
    imperfect = [Perturbation(wire=f"{mirror}.1", k_factor=1.2)]
    limit = QuantityRequirement(quantity="lowest pitch", at_most=100.0, perturbation=imperfect)
    number = Free(name=f"stage.{mirror}.wires.d", lower=1e-4, upper=3e-3)
    goals = Goals(free=[number], requirement=[limit])
    (target,) = targets.interpret(goals, names_of(design), "design.toml").target
    own = {"perturbation": [{"wire": f"{mirror}.1", "k_factor": 1.2}]}
    found = targets.with_imperfections(design.design, target.perturbation)
    assert found == design.replace(own).design


def test_requirements_of_the_design_are_goals():
    text = VERTICAL.read_text() + REQUIRED
    found = pendulum([free("l", 0.1, 1.0)], text)
    assert found.limits.group == ("soft",)
    assert found.numbers.after[0] == pytest.approx(G / (2 * np.pi * 0.8) ** 2, rel=1e-5)


def test_requirements_of_the_design_may_be_left_out():
    text = VERTICAL.read_text() + REQUIRED
    with pytest.raises(InputError, match="nothing is limited"):
        pendulum([free("l", 0.1, 1.0)], text, design_requirements=False)
    wanted = [QuantityRequirement(quantity="test height", at_most=0.5)]
    found = pendulum([free("l", 0.1, 1.0)], text, requirement=wanted, design_requirements=False)
    assert found.limits.name == ("test height <= 0.5 m",)


def test_thermal_noise_is_that_of_thermal_on_the_design_found():
    """Thin wires are quiet; the frequency of the bounce mode goes as their radius."""
    wanted = [QuantityRequirement(quantity="test vertical", at_least=15.0)]
    objective = [Objective(minimise="thermal test.x:30")]
    goals = Goals(free=[free("radius", 0.7e-4, 1.5e-4)], requirement=wanted, objective=objective)
    design = sus.template("single")
    found = searching.solve(design, goals, level="beam")
    assert found.met
    before = sus.modes(design, fidelity="beam")
    bounce = before.frequency[list(before.label).index("test vertical")]
    assert found.numbers.after[0] == pytest.approx(1e-4 * 15.0 / bounce, rel=1e-3)
    how = {"outputs": ["test.x"], "frequency": [30.0], "fidelity": "beam"}
    quiet = sus.thermal(sus.parse(found.toml), **how).amplitude[0]
    assert found.quantities.after[1] == pytest.approx(quiet, rel=1e-9)
    assert quiet < 0.9 * sus.thermal(design, **how).amplitude[0]


def test_a_steady_state_of_a_design_that_falls_over_is_not_claimed():
    """Wires that end too far below the centre of mass: no response, so no isolation that is met."""
    wanted = [QuantityRequirement(quantity="test.x/support.x:50", at_most=1.0)]
    numbers = [Free(name="stage.upper.wires.d", lower=-0.06, upper=-0.05, start=-0.05)]
    found = pendulum(numbers, DOUBLE, requirement=wanted)
    assert np.isnan(found.limits.value).all()
    assert not found.met


OPTIMA = {
    "pitch below the pendulum mode": (
        sus.parse(SMALL).text,
        [Goal(kind="band", modes=["test pitch"], at_most=0.9)],
        {f"{WIRES}.d": (-6e-4, 3e-3)},
        [-1.54281879e-4],
    ),
    "two out of reach": (
        VERTICAL.read_text(),
        [
            Goal(kind="isolation", response="test.x/support.x:10", at_most=1e-9),
            Goal(kind="height", at_most=0.3),
            Goal(kind="band", modes=["test pitch"], equals=3.0),
            Goal(kind="band", modes=["test yaw"], at_least=50.0),
        ],
        {f"{WIRES}.l": (0.1, 0.5), f"{WIRES}.s": (0.005, 0.06)},
        [0.2999997000001332, 0.016963192638011427],
    ),
    "couplings, stresses and an objective": (
        DOUBLE,
        [
            Goal(kind="coupling", dof=["x"], at_least=0.2),
            Goal(kind="stress", at_most=0.3),
            Goal(kind="band", dof=["x"], lowest=1, minimise=True),
        ],
        {f"{WIRES}.l": (0.1, 0.5), "stage.upper.wires.l": (0.1, 0.5)},
        [0.4015364941058627, 0.5],
    ),
}
"""Optima of 1.0.0 before goals were requirements on quantities: design, goals, bounds, numbers."""


@pytest.mark.parametrize("name", OPTIMA)
def test_short_forms_have_the_optima_that_they_had(name):
    text, goals, bounds, expected = OPTIMA[name]
    numbers = [Free(name=path, lower=low, upper=high) for path, (low, high) in bounds.items()]
    level = "string" if len(goals) == 4 else "beam"
    found = searching.solve(sus.parse(text), Goals(goal=goals, free=numbers), level=level)
    np.testing.assert_allclose(found.numbers.after, expected, rtol=1e-6)


def test_a_fault_of_the_design_s_own_requirement_names_the_design(tmp_path):
    design = tmp_path / "mine.toml"
    design.write_text(VERTICAL.read_text() + REQUIRED.replace("transverse", "sideways"))
    goals = tmp_path / "goals.toml"
    goals.write_text(f'[[free]]\nname = "{WIRES}.l"\nlower = 0.1\nupper = 1.0\n')
    result = run("optimise", design, goals, "--starts", "1", "--out", tmp_path / "out")
    [line] = assert_refused(result, design, tmp_path / "out")
    assert 'requirement.1.quantity = "test sideways"' in line
