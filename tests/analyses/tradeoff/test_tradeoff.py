"""What `pendsus tradeoff` makes of what it measures: the front, the timing, what is left out and
why."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.analyses.tradeoff import imperfect_builds, response_times, timing
from suspension_cli.analyses.tradeoff import solve as run
from suspension_cli.analyses.tradeoff.comparisons import COMPARISONS, QUANTITIES
from suspension_cli.analyses.tradeoff.result import GAIN, ROUNDING, format_error, format_time, front
from suspension_cli.analyses.tradeoff.subject import MODEL_NAMES, Subject
from suspension_cli.design.reader import read
from suspension_cli.equilibrium import solve as equilibrium
from tests.support import scenes
from tests.support.paths import CONFIGS
from tests.support.quick_tradeoff import hurry


def subject(name):
    return Subject(read(CONFIGS / f"{name}.toml").design)


# The front.


def test_front_of_made_up_points():
    time, error = [2.0, 1.0, 4.0, 3.0, 5.0], [1e-3, 1e-1, 1e-5, 1e-2, 1e-5]
    assert front(time, error) == [1, 0, 2]
    assert front([1.0], [0.3]) == [0]
    assert front([], []) == []


def test_front_takes_rounding_for_no_gain():
    assert front([1.0, 2.0], [0.9 * ROUNDING, 0.0]) == [0]
    assert front([1.0, 2.0, 3.0], [1e-3, 1e-3 * (1 - GAIN / 2), 1e-3 * (1 - 2 * GAIN)]) == [0, 2]


def test_front_of_equal_times_keeps_the_better():
    assert front([1.0, 1.0], [1e-2, 1e-3]) == [1]


def test_front_against_its_definition():
    """On it is what nothing beats; each other point is beaten by one that is on it."""
    rng = np.random.default_rng(1)
    for _ in range(50):
        time, error = rng.integers(1, 8, 12).astype(float), 10.0 ** -rng.integers(0, 8, 12)
        on = front(time, error)
        beaten = (
            (time[:, None] >= time)
            & (error[:, None] >= error)
            & ((time[:, None] > time) | (error[:, None] > error))
        )
        assert {(time[n], error[n]) for n in on} == {
            (time[n], error[n]) for n in np.flatnonzero(~beaten.any(1))
        }
        assert all(beaten[n][on].any() for n in np.flatnonzero(beaten.any(1)))
        assert (np.diff(time[on]) > 0).all() and (np.diff(error[on]) < 0).all()


# Measuring.


def test_works_take_turns(monkeypatch):
    monkeypatch.setattr(timing, "LEAST", 0.0)
    calls = []
    found = timing.quartiles([lambda name=name: calls.append(name) for name in "abc"], 4)
    assert "".join(calls[-12:]) == "abcabcabcabc"
    assert found.shape == (3, 3)
    assert (np.diff(found, axis=1) >= 0).all()


def test_quick_works_are_done_often():
    calls = []
    timing.quartiles([lambda: calls.append(1)], 2)
    assert len(calls) == 1 + timing.TRIES + 2 * timing.MOST
    assert timing.quartiles([], 2).shape == (0, 3)


def test_slow_works_have_fewer_samples(monkeypatch):
    """Called until the budget is spent; what took ten budgets before is not called again."""
    clock = [0.0]
    monkeypatch.setattr(timing.time, "process_time", lambda: clock[0])
    calls = {0.3: 0, 0.05: 0, 2.0: 0}

    def work(seconds):
        calls[seconds] += 1
        clock[0] += seconds

    works = [lambda s=seconds: work(s) for seconds in calls]
    found = timing.quartiles(works, 5, [0.4, 0.06, 2.1], budget=0.1)
    assert calls == {0.3: 2, 0.05: 3, 2.0: 0}  # one call before those that are samples
    np.testing.assert_allclose(found[:, 1], [0.3, 0.05, 2.1])


def test_sessions_time_a_first_response_and_the_next_ones(monkeypatch):
    """What is kept from the first response, and from one grid, is found again."""
    clock, budget = [0.0], 0.1
    monkeypatch.setattr(timing.time, "process_time", lambda: clock[0])

    def begin(scale):
        def start():
            clock[0] += 5 * scale
            grids = []

            def answer(omega):
                clock[0] += scale * (1 if not grids or (grids[-1] != omega).any() else 0.5)
                grids.append(omega)

            return answer

        return lambda: start

    quick, slow = response_times._times([begin(1e-3), begin(1.0)], 5, 3, budget)
    np.testing.assert_allclose(quick[:, 1], [6e-3, 0.5e-3, 1e-3])
    assert slow[0, 1] == pytest.approx(6.0) and np.isnan(slow[1:]).all()


def test_invalid_methods_are_left_out_with_a_reason(monkeypatch):
    """Strings known by k alone: no model with bending, no thermal noise; explicit wires: no force
    model."""
    hurry(monkeypatch)
    body = {"mass": 2.0, "inertia": [0.014, 0.011, 0.012]}
    raw = scenes.raw_of(
        {
            "name": "test",
            "body": body,
            "wires": {"count": 2, "l": 0.3, "t1": 0.05, "t2": 0.05, "d": 0.01, "k": 1e4},
        }
    )
    found = run.measure(scenes.design_of(raw), ("modes", "thermal", "coupling"), repeat=2)
    assert [panel.key for panel in found.panels] == [
        "modes-models",
        "modes-methods",
        "thermal-models",
        "thermal-methods",
        "coupling-models",
        "coupling-methods",
    ]
    models = found.panels[0]
    assert [entry.model for entry in models.entries] == ["force", "string"]
    assert {item.model: item.reason for item in models.left} == {
        "closed-form": "it does not hang on one symmetric set of four wires",
        "beam": "wire test.1 has no cross-section",
        "violin": "wire test.1 has no cross-section",
    }
    for panel in found.panels[2:4]:
        assert panel.entries == () and panel.views == ()
        assert all("wire test.1 has no cross-section" in item.reason for item in panel.left)


def four_wires(**wires):
    body = {"mass": 2.0, "inertia": [0.014, 0.011, 0.012]}
    shape = {"count": 4, "s": 0.03, "t1": 0.05, "t2": 0.05, "d": 0.002}
    return Subject(
        scenes.design_of(scenes.raw_of({"name": "test", "body": body, "wires": shape | wires}))
    )


def test_builds_without_equilibrium_are_reported_with_the_model(monkeypatch):
    """Leaning wires too stiff to be balanced hang on no model; thick short ones, where one is slack
    once they bend, on strings alone."""
    hurry(monkeypatch)
    # what hangs nowhere is given up early
    monkeypatch.setattr(equilibrium, "STEPS", equilibrium.STEPS[:1])
    rigid = four_wires(l=0.3, t1=0.04, k=1e17)
    reason = "imperfect builds in the string model: no equilibrium near the nominal pose"
    assert (
        imperfect_builds.why_no_equilibrium(rigid)
        == imperfect_builds.uncoupled(rigid)
        == imperfect_builds.unbalanced(rigid)
        == reason
    )
    # these do not hold at all, for another reason
    assert imperfect_builds.why_no_equilibrium(rigid, ("beam", "violin")) == ""
    thick = four_wires(l=0.05, material="steel302", radius=1e-3)
    assert imperfect_builds.why_no_equilibrium(thick) == imperfect_builds.uncoupled(thick) == ""
    assert (
        imperfect_builds.incomparable(thick)
        == "imperfect builds in the beam model: a wire is slack"
    )
    models, methods = run.measure(thick.design, ("coupling",), repeat=2).panels
    assert models.entries == () and {item.reason for item in models.left} == {
        imperfect_builds.incomparable(thick)
    }
    assert [entry.method for entry in methods.entries] == [
        "first order",
        "nominal pose",
        "linear pose",
        "rebuilt",
    ]
    good = four_wires(l=0.3, material="steel302", radius=1e-4)
    assert imperfect_builds.incomparable(good) == ""


def test_every_model_is_compared():
    for item in COMPARISONS:
        if item.compares == "models":
            assert [method.model for method in item.methods] == list(MODEL_NAMES)
    assert set(QUANTITIES) == {"modes", "response", "thermal", "coupling", "equilibrium"}


def test_bodies_on_springs_alone_have_every_model(monkeypatch):
    hurry(monkeypatch)
    spring = {
        "stiffness": [100.0, 200.0, 300.0, 1.0, 2.0, 3.0],
        "preload": [0.0, 0.0, 19.62, 0.0, 0.0, 0.0],
    }
    raw = scenes.raw_of(
        {
            "name": "test",
            "position": [0.0, 0.0, -0.1],
            "body": {"mass": 2.0, "inertia": [0.014, 0.011, 0.012]},
            "spring": [spring],
        }
    )
    found = run.measure(scenes.design_of(raw), ("modes", "coupling", "equilibrium"), repeat=2)
    assert [entry.model for entry in found.panels[0].entries] == ["string", "beam", "violin"]
    assert max(entry.error.max() for entry in found.panels[0].entries) < 1e-12
    assert {item.reason for panel in found.panels[2:] for item in panel.left} == {
        "the mirror hangs on no wire"
    }


def test_words():
    assert [format_time(value) for value in (2.0, 0.0123, 83e-6, 5e-10)] == [
        "2 s",
        "12.3 ms",
        "83 µs",
        "0.5 ns",
    ]
    assert (format_error(3.8e-7), format_error(1e-17), format_error(0.0)) == ("3.8e-07", "0", "0")


def test_no_time_is_zero(monkeypatch):
    """Where the clock of processor time stands still within a sample; others are divided by it."""
    monkeypatch.setattr(timing.time, "process_time", lambda: 1.0)
    assert (timing.quartiles([lambda: None], 1) > 0).all()
