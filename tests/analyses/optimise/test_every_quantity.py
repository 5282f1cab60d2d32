"""Every kind of quantity as a goal of `pendsus optimise`, and closed forms."""

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
from suspension_cli.quantities import solved, vocabulary
from suspension_cli.quantities.needs import Needs
from suspension_cli.quantities.quantity import evaluate
from tests.support.commandline import assert_refused, run
from tests.support.exchanging import SMALL
from tests.support.optima import VERTICAL, WIRES, G, free

SINGLE = sus.template("single").text.replace(
    "[stage.wires]",
    """[stage.blades]
count = 2
loss_angle = 1e-3

[stage.blades.geometry]
length = 0.2
base_width = 0.05
thickness = 1.5e-3
shape_factor = 1.5
material = "maraging"

[[perturbation]]
body = "test"
com_offset = [1e-4, 2e-4, 0.0]

[[control.loop]]
name = "x"
sensor = "test.x"
actuator = "test.force_x"
damper = 2.0
sensor_noise = 1e-10

[stage.wires]""",
)
DOUBLE = sus.example("double").text
LENGTH = f"{WIRES}.l", 0.27, 0.30
HEIGHT = f"{WIRES}.d", 0.5e-3, 2e-3
RADIUS = f"{WIRES}.radius", 0.9e-4, 1.1e-4
MASS = "stage.test.body.mass", 5.0, 6.0
ABSORBED = "heat.absorbed.test", 0.5e-4, 2e-4
HEAT = "[heat]\nheld = { support = 290.0 }\nabsorbed = { test = 1e-4 }\n"
GOALS = {
    "peak|largest|smallest of OUTPUT/INPUT:LOW:HIGH": ("largest of test.x/support.x:2:5", LENGTH),
    "Q of MODE": ("Q of test longitudinal", LENGTH),
    "decay of MODE": ("decay of test longitudinal", MASS),
    "settling of MODE": ("settling of test longitudinal", MASS),
    "dilution of MODE": ("dilution of test yaw", LENGTH),
    "tension WIRE, tension STAGE wires": ("tension test wires", MASS),
    "stress WIRE, stress STAGE wires|blades": ("stress test wires", RADIUS),
    "stress fraction WIRE, stress fraction STAGE wires|blades": ("stress fraction test.1", RADIUS),
    "sag of BLADE, sag of STAGE blades": ("sag of test blades", MASS),
    "margin LOOP.gain|phase|delay|distance": ("margin x.delay", MASS),
    "fraction of STAGE MOTION in MODE": ("fraction of upper pitch in test pitch", LENGTH),
    "top fraction of MODE": ("top fraction of test pitch", LENGTH),
    "distance MODE, MODE": ("distance test pitch, lowest yaw", LENGTH),
    "difference MODE, MODE": ("difference test pitch, yaw 1", LENGTH),
    "STAGE MOTION, STAGE MOTION#N": ("test pitch", HEIGHT),
    "N": ("3", LENGTH),
    "lowest MOTION": ("lowest pitch", HEIGHT),
    "FAMILY N": ("longitudinal-pitch 2", HEIGHT),
    "noise MOTION:FREQUENCY": ("noise test.x:10", LENGTH),
    "rms MOTION, rms MOTION:LOW:HIGH, rms coil OSEM": ("rms test.x:0.5:5", LENGTH),
    "STAGE static x|y|height|roll|pitch|yaw": ("test static pitch", HEIGHT),
    "STAGE height": ("test height", LENGTH),
    "temperature of STAGE": ("temperature of test", ABSORBED),
    "OUTPUT/INPUT:FREQUENCY, OVER/UNDER/INPUT:FREQUENCY": ("test.x/support.x:10", LENGTH),
    "coupling": ("coupling", LENGTH),
    "thermal MOTION:FREQUENCY": ("thermal test.x:10", RADIUS),
    "force noise FORCE:FREQUENCY": ("force noise test.torque_yaw:1e-3", RADIUS),
    "STAGE violin ORDER, lowest violin": ("test violin 1", RADIUS),
}
"""A quantity of each kind, and a number that changes it, with bounds."""
KINDS = [kind.pattern for kind in vocabulary.every_kind()]


def design_for(pattern: str) -> str:
    """Text of the design for a kind: with two bodies, or undamped, where that matters."""
    if pattern in ("top fraction of MODE", "fraction of STAGE MOTION in MODE"):
        return DOUBLE
    if pattern == "dilution of MODE":  # only losses in wires
        return sus.template("single").text
    if pattern.startswith("temperature"):
        return sus.template("single").text + HEAT
    if pattern.startswith("margin"):  # margins of strings alone take less time
        head, wires = SINGLE.split("[stage.wires]")
        kept = [row for row in wires.splitlines() if not row.startswith(("material", "radius"))]
        return "\n".join([head, "[stage.wires]", *kept, "k = 2e4\n"])
    return SINGLE


def level_of(text: str) -> str:
    """Model in which a design is evaluated."""
    return "string" if "\nk = " in text else "beam"


def evaluated(text: str, name: str) -> float:
    """Value of a quantity of a design, with bending if its wires have a radius."""
    design = sus.parse(text)
    quantity = vocabulary.parse(name, names_of(design), "--result")
    [(_, batch)] = solved.of_designs([design.design], level_of(text), Needs.of([quantity]))
    return float(evaluate([quantity], batch)[0, 0])


def solve(text: str, number: tuple[str, float, float], **goals):
    """Optimise one number of a design."""
    name, lower, upper = number
    wanted = Goals(free=[Free(name=name, lower=lower, upper=upper)], **goals)
    return searching.solve(sus.parse(text), wanted, level=level_of(text))


@pytest.mark.parametrize("pattern", KINDS)
def test_each_kind_is_a_requirement(pattern):
    """The nearest design that meets a limit between the values at the start and at a bound."""
    name, number = GOALS[pattern]
    text = design_for(pattern)
    path, *bounds = number
    start = abs(evaluated(text, name))
    end = abs(evaluated(sus.parse(text).replace({path: bounds[1]}).text, name))
    limit = (start + end) / 2
    side = "at_least" if end > start else "at_most"
    found = solve(text, number, requirement=[QuantityRequirement(quantity=name, **{side: limit})])
    assert found.met
    again = evaluated(found.toml, name)
    assert found.quantities.after[0] == pytest.approx(again, rel=1e-6)
    assert abs(again) == pytest.approx(limit, rel=1e-5)
    assert found.limits.active.all()


@pytest.mark.parametrize("pattern", KINDS)
def test_each_kind_is_an_objective(pattern):
    """All are monotonic in the number: the optimum is at one of its bounds, whichever is better."""
    name, number = GOALS[pattern]
    text = design_for(pattern)
    path, *bounds = number
    ends = [abs(evaluated(sus.parse(text).replace({path: end}).text, name)) for end in bounds]
    found = solve(text, number, objective=[Objective(minimise=name)])
    assert abs(found.quantities.after[0]) == pytest.approx(min(ends), rel=1e-6)
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
