"""What `pendsus optimise` finds: known optima, ties to the last bit, and no goal claimed that is
not met; and what it computes from a design: exact derivatives, stress, shares."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import msgspec
import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.optimise.free_numbers import FreeDesign
from suspension_cli.analyses.optimise.targets import with_imperfections
from suspension_cli.design import reader
from suspension_cli.design.derive import com_positions
from suspension_cli.design.goals import Equal, Free, Goal, Goals
from suspension_cli.errors import InputError
from suspension_cli.linear import damped, eigenmodes
from suspension_cli.models import registry
from suspension_cli.physics import statics
from tests.support import derivatives as differences
from tests.support.designs import TEXTS
from tests.support.exchanging import SMALL, D, pendulum_and_pitch
from tests.support.optima import (
    ANGLED,
    EVERY,
    FIGURE3,
    PAPER,
    TRIPLE,
    VERTICAL,
    WIRES,
    G,
    band,
    free,
    solved,
    values_of,
)


def test_a_search_survives_places_without_a_design():
    """Angled wires (equation 7): the height of the wires is g/omega^2, and nothing hangs on wires
    shorter than their span in y."""
    span = 0.133 - 0.047
    found = solved(
        ANGLED, [band("test longitudinal", equals=1.6)], [free("l", 0.02, 0.6)], starts=3
    )
    assert found.numbers.after[0] == pytest.approx(
        np.hypot(G / (2 * np.pi * 1.6) ** 2, span), rel=1e-9
    )


def test_the_largest_rotation():
    """omega^2 = m g (s^2 + t^2)/(l I) (equation 4): the widest wires as short as they may be; a
    half is gained for each share of the length."""
    numbers = [free("s", 0.01, 0.06), free("l", 0.1, 1.0)]
    limit = [band("test yaw", maximise=True), Goal(kind="height", at_least=0.3)]
    found = solved(VERTICAL, limit, numbers, starts=3)
    inertia = reader.read(VERTICAL).design.stage[0].body.inertia[2]
    np.testing.assert_allclose(found.numbers.after, [0.06, 0.3], rtol=3e-6)
    assert found.numbers.bound.tolist() == [1, 0]
    assert found.quantities.after[0] == pytest.approx(
        np.sqrt(20 * G * (0.06**2 + 0.133**2) / (0.3 * inertia)) / (2 * np.pi), rel=1e-5
    )
    assert found.limits.active.all() and found.limits.multiplier[0] == pytest.approx(0.5, rel=1e-6)
    # ln omega = ln(s^2 + t^2)/2 + ..., by s over all of its way
    assert found.numbers.multiplier[0] == pytest.approx(
        0.06 / (0.06**2 + 0.133**2) * 0.05, rel=1e-5
    )
    assert found.stationarity < 1e-6
    assert (found.starts.place == 1).all()


def test_the_largest_margins():
    """Between two limits on one frequency the best place is their geometric mean, where both
    margins are alike."""
    found = solved(
        VERTICAL,
        [band("test longitudinal", at_least=0.5, at_most=0.9)],
        [free("l", 0.1, 1.2)],
        prefer="margin",
    )
    assert found.quantities.after[0] == pytest.approx(np.sqrt(0.5 * 0.9), rel=1e-6)
    np.testing.assert_allclose(found.limits.multiplier, [0.5, 0.5], rtol=1e-5)


def test_the_nearest_design():
    """Of all that keep to a limit the one that changes least: here the projection on a line of
    equal height."""
    numbers = [
        Free(name="stage.upper.wires.l", lower=0.1, upper=0.6),
        Free(name="stage.test.wires.l", lower=0.1, upper=0.6),
    ]
    raw = tomllib.loads(TEXTS["double"])
    for stage in raw["stage"]:
        stage["wires"]["t1"] = stage["wires"]["t2"]
    text = reader.write_toml(raw)
    start = FreeDesign.of(text, Goals(goal=[Goal(kind="height", at_most=1.0)], free=numbers)).start
    drawn = solved(text, [Goal(kind="height", at_most=5.0)], numbers)
    np.testing.assert_array_equal(drawn.numbers.after, start)
    height = drawn.quantities.after[0]
    found = solved(text, [Goal(kind="height", at_most=height - 0.1)], numbers)
    np.testing.assert_allclose(found.numbers.after, start - 0.05, atol=1e-6)
    assert found.limits.active.all() and found.met


def test_what_is_not_known_is_not_met():
    """Blades without dimensions have a stress that nobody knows: that is said, and not taken for
    met."""
    found = solved(
        PAPER / "table2.toml",
        [Goal(kind="stress", at_most=0.5)],
        [Free(name="stage.upper.wires.radius", lower=1e-4, upper=3e-4)],
    )
    assert [what.partition(":")[0] for what in found.unknown] == [
        "stress of upper blades",
        "stress of middle blades",
    ]
    assert found.limits.met.all() and not found.met


def test_ties_hold_to_the_last_bit():
    """Numbers that follow are what their terms make of the numbers written, and keep to bounds of
    their own."""
    numbers = [
        Free(name="stage.upper.wires.l", lower=0.1, upper=0.5),
        Free(name="stage.test.body.mass", lower=3.0, upper=9.0),
    ]
    ties = [
        Equal(
            name="stage.test.wires.l", terms={"stage.upper.wires.l": -1.0}, offset=0.7, lower=0.3
        ),
        Equal(
            name="stage.upper.body.mass",
            terms={"stage.test.body.mass": 1.1, "stage.upper.wires.radius": 1e3},
            offset=-0.3,
        ),
    ]
    found = solved(
        TEXTS["double"], [Goal(kind="band", dof=["x"], lowest=1, minimise=True)], numbers, ties
    )
    design = reader.parse(found.toml)
    upper, test = design.stage
    assert test.wires.l == 0.7 + -1.0 * upper.wires.l
    assert upper.body.mass == -0.3 + (1.1 * test.body.mass + 1e3 * upper.wires.radius)
    assert test.wires.l >= 0.3 - 1e-9
    assert found.numbers.tied.tolist() == [False, False, True, True]


def test_modes_are_followed_by_their_shapes_through_crossings():
    """Tilt of Figure 3 lies above the longitudinal mode as drawn; below it, it is still tilt."""
    found = solved(FIGURE3, [band("test pitch", at_most=0.9)], [free("s", 1e-4, 0.05, scale="log")])
    assert found.met and found.quantities.before[0] > 5
    again = eigenmodes.solve(registry.STRING.system(reader.parse(found.toml)))
    assert again.label[found.quantities.mode[0]] == "test pitch"
    assert again.frequency[found.quantities.mode[0]] <= 0.9 < 1.1 < again.of("x")[0]


@pytest.mark.parametrize(
    ("start", "limit"), [(2.5e-3, {"at_most": 0.9}), (2e-4, {"at_least": 1.5})]
)
@pytest.mark.parametrize("level", ["string", "auto"])
def test_through_an_exchange_of_character(start, limit, level):
    """Pitch reaches limits on the other side of the pendulum mode, with which it mixes, and the
    table of modes of the design found agrees."""
    text = sus.parse(SMALL).replace({D: start}).text
    lowest = -6e-4 if level == "auto" else 1e-5
    found = solved(text, [band("test pitch", **limit)], [free("d", lowest, 3e-3)], level=level)
    assert found.met
    assert not found.remarks
    table = sus.modes(sus.parse(found.toml), fidelity=found.fidelity)
    frequency = table.frequency[table.label.index("test pitch")]
    assert table.label.count("test pitch") == 1
    assert frequency == pytest.approx(next(iter(limit.values())), rel=1e-5)
    assert frequency == pytest.approx(found.limits.value[0], rel=1e-7)


def test_of_two_modes_that_share_a_motion_the_worse_counts():
    """Where pitch is half in the pendulum mode, each limit takes the one that violates it more."""
    halves = [d for d in np.linspace(6e-4, 12e-4, 301) if pendulum_and_pitch(d)[1].max() < 0.53]
    d = halves[len(halves) // 2]
    low, high = np.sqrt(pendulum_and_pitch(d)[0]) / (2 * np.pi)
    text = sus.parse(SMALL).replace({D: d}).text
    limits = [band("test pitch", at_most=0.9, at_least=1.5)]
    found = solved(text, limits, [free("d", d * (1 - 1e-9), d * (1 + 1e-9))])
    assert dict(zip(found.limits.sense, found.limits.value, strict=True)) == pytest.approx(
        {"at_least": low, "at_most": high}, rel=1e-6
    )
    [remark] = found.remarks
    assert remark.startswith("two modes share test pitch in this design: ")
    assert f"{low:.5g}" in remark
    assert f"{high:.5g}" in remark


def test_modes_lie_apart():
    """Two frequencies that were 6 % apart end 20 % apart, or 0.2 Hz."""
    for limit in (
        Goal(kind="separation", dof=["x", "yaw"], at_least=1.2),
        Goal(kind="separation", dof=["x", "yaw"], at_least=0.2, apart="hertz"),
    ):
        text = VERTICAL.read_text()
        numbers = [free("l", 0.1, 1.0), free("s", 0.01, 0.05), free("t1", 0.01, 0.2)]
        tie = [Equal(name=f"{WIRES}.t2", terms={f"{WIRES}.t1": 1.0})]
        near = [free("l", 0.1, 1.0, start=0.3), numbers[1], free("t1", 0.01, 0.2, start=0.07)]
        found = solved(text, [limit], near, tie)
        model = registry.STRING.system(reader.parse(found.toml))
        ranked = sorted(
            f
            for mode, f in zip(
                eigenmodes.solve(model).home, eigenmodes.solve(model).frequency, strict=True
            )
            if mode[1] in ("x", "pitch", "yaw")
        )
        ratios, gaps = np.divide(ranked[1:], ranked[:-1]), np.diff(ranked)
        assert found.met and (ratios if limit.apart is None else gaps).min() >= limit.at_least
        before, after = (one.min() for one in (found.quantities.before, found.quantities.after))
        least = limit.at_least - (1 if limit.apart is None else 0)  # a distance, ratio less 1
        assert before < least <= after


def test_the_search_continues_on_the_models_that_its_result_needs():
    """Thin wires are strings; the thick ones that a stiff vertical mode takes bend."""
    goal = [
        band("test vertical", at_least=10.0),
        Goal(kind="isolation", response="test.x/support.x:100", at_most=1e-3),
    ]
    numbers = [free("radius", 1e-5, 4e-4, start=2e-5)]
    found = solved(VERTICAL, goal, numbers, level="auto")
    assert found.met
    assert found.fidelity == "violin"
    assert "wire mass changes test.x/support.x:100 by up to" in found.reason
    assert found.checked == "checked with the violin model"
    assert found.limits.margin.min() == pytest.approx(1e-6, rel=1e-3)  # on these models


@pytest.mark.parametrize("first", [0, 1])
def test_of_limits_that_exclude_each_other_the_first_is_met(first):
    """The other is approached as far as that permits, and is not claimed."""
    goal = [band("test longitudinal", at_least=1.2), Goal(kind="height", at_least=0.3)]
    numbers = [free("l", 0.1, 1.0)]
    found = solved(VERTICAL, goal if first == 0 else goal[::-1], numbers, starts=2)
    assert not found.met and found.limits.met.tolist() == [True, False]
    length = G / (2 * np.pi * 1.2) ** 2 if first == 0 else 0.3
    assert found.numbers.after[0] == pytest.approx(length, rel=1e-5)
    # f = sqrt(g/l)/2 pi: of the violation of the second, by the margin of the first
    cost = 2.0 if first == 0 else 0.5
    np.testing.assert_allclose(found.limits.multiplier, [cost, 0.0], rtol=1e-5)


@pytest.mark.parametrize("impossible", [{"at_least": 30.0}, {"equals": 30.0}])
@pytest.mark.parametrize(
    ("possible", "pitch"),
    [({"at_most": 4.0}, 4.0), ({"equals": 3.0}, 3.0), ({"at_most": 20.0}, None)],
)
def test_a_goal_that_can_be_met_is_met_beside_one_that_cannot(impossible, possible, pitch):
    """The shortest wires give 1.58 instead of 30 Hz; the pitch is a matter of their distance."""
    goal = [band("test longitudinal", **impossible), band("test pitch", **possible)]
    numbers = [free("l", 0.1, 0.5), free("s", 0.005, 0.06)]
    found = solved(VERTICAL, goal, numbers)
    assert found.limits.met.tolist() == [False, True]
    assert found.numbers.after[0] == pytest.approx(0.1, rel=1e-6)
    assert found.limits.value[0] == pytest.approx(np.sqrt(G / 0.1) / (2 * np.pi), rel=0.01)
    if pitch is None:  # met as drawn
        assert found.numbers.after[1] == pytest.approx(found.numbers.before[1], rel=1e-3)
    else:  # the nearest design
        assert found.limits.value[1] == pytest.approx(pitch, rel=1e-5)


@pytest.mark.parametrize("two", [False, True])
def test_a_goal_that_cannot_be_met_spoils_no_other(two):
    """Isolation grows with the length of wires, as does the height: an isolation that is out of
    reach is met as well as the height permits, and the height is met."""
    goal = [
        Goal(kind="isolation", response="test.x/support.x:10", at_most=1e-9),
        Goal(kind="height", at_most=0.3),
        band("test pitch", equals=3.0),
        *([band("test yaw", at_least=50.0)] if two else []),
    ]
    numbers = [free("l", 0.1, 0.5), free("s", 0.005, 0.06)]
    found = solved(VERTICAL, goal, numbers)
    assert found.limits.met.tolist() == [False, True, True, False][: 4 if two else 3]
    assert found.quantities.after[1] == pytest.approx(0.3, rel=2e-6)
    # omega_0^2 / (omega^2 - omega_0^2), and (omega_0/omega_pitch)^2 of it by pitch at the COM: 0
    ratio = G / found.numbers.after[0] / (2 * np.pi * 10) ** 2
    assert found.quantities.after[0] == pytest.approx(ratio / (1 - ratio), rel=0.01)


def test_derivatives_of_every_kind_of_goal():
    """Along a change of all numbers at once, against differences of the eighth order, ties and the
    imperfect equilibrium included."""
    every = values_of(TRIPLE.read_text(), EVERY)
    # away from coincidences of the design as drawn
    start = every.freed.begin + np.array([0.01, 0.02, -0.03, 0.03, 0.01])
    change, step = 0.3 * np.array([0.6, -0.8, 1.0, 0.7, -0.9]), 2e-3
    found = every.slopes(start) @ change
    slope = sum(
        weight * (every.at(start + n * step * change) - every.at(start - n * step * change))
        for n, weight in differences.STENCIL.items()
    )
    np.testing.assert_allclose(found, slope / step, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("hinged", [False, True])
def test_stress_and_height_are_those_of_check(hinged):
    """Of each design of a batch, and none where a wire is slack."""
    raw = tomllib.loads(TRIPLE.read_text())
    if hinged:
        del raw["stage"][2]["wires"]["clamp"]
        raw["stage"][2]["wires"]["bending"] = "hinged"
    raw["perturbation"] = [
        {"body": "test", "com_offset": [1e-4, 2e-4, 0.0]},
        {"wire": "test.1", "length_change": -1e-4},
    ]
    goals = Goals(
        goal=[Goal(kind="stress", at_most=1.0), Goal(kind="height", at_most=1.0)],
        free=[Free(name="stage.test.wires.l", lower=0.2, upper=0.4)],
    )
    values = values_of(reader.write_toml(raw), goals)
    designs = [values.freed.design(np.array([place])) for place in (0.2, 0.5)]
    loose = msgspec.structs.replace(designs[0].perturbation[1], length_change=2e-3)
    designs += [with_imperfections(designs[0], [loose])]
    *good, slack = [values.report(design).value for design in designs]
    assert np.isnan(slack).all()
    with pytest.raises(InputError, match="slack"):
        statics.solve(designs[-1])
    for design, found in zip(designs, good, strict=False):
        loads = statics.solve(design)
        parts = [part for part in (*loads.wires, *loads.blades) if part.fraction is not None]
        height = -com_positions(design)["test"][2] - loads.bodies[-1].shift[2]
        expected = [*(part.fraction for part in parts), height]
        np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_top_mass_fraction_is_the_damping_rate_from_there():
    """With C = beta M of the top mass every pole moves to the left by beta/2 of its share, for a
    small beta."""
    model, beta = registry.STRING.system(reader.read(TRIPLE).design), 1e-4
    top = np.zeros_like(model.mass)
    top[6:12, 6:12] = beta * model.mass[6:12, 6:12]
    found, slowed = eigenmodes.solve(model), damped.solve(replace(model, damping=top))
    for frequency, share in zip(found.frequency, found.top_fraction, strict=True):
        near = slowed.decay_rate[np.abs(slowed.frequency / frequency - 1) < 1e-7]
        assert np.abs(near / (beta / 2) - share).min() < 1e-6


def test_numbers_have_no_more_digits_than_matter():
    """Both lengths together are limited by the height: rounded, they still are below it, all
    quantities are those of the rounded design, and change by less than was allowed."""
    numbers = [
        Free(name="stage.upper.wires.l", lower=0.1, upper=0.6),
        Free(name="stage.test.wires.l", lower=0.1, upper=0.6),
    ]
    goals = [Goal(kind="height", at_most=0.7)]
    exact = solved(TEXTS["double"], goals, numbers)
    found = solved(TEXTS["double"], goals, numbers, rounding=0.1)
    assert found.met and 0 < found.digits <= 5
    written = [sus.parse(found.toml)[name] for name in found.numbers.name]
    assert written == found.numbers.after.tolist()
    assert written == [float(f"{value:.{found.digits}g}") for value in written]
    np.testing.assert_allclose(found.quantities.after, exact.quantities.after, rtol=found.rounding)
    height = values_of(found.toml, Goals(goal=goals, free=numbers)).report(
        sus.parse(found.toml).design
    )
    np.testing.assert_allclose(height.value, found.quantities.after, rtol=1e-12)
