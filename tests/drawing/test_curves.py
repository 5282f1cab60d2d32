"""Pictures of curves: labels, units, phases and marks that make their point."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

import suspension_cli as sus
from suspension_cli.analyses.response.picture import draw as draw_response
from suspension_cli.analyses.xcouple.picture import draw as draw_coupling
from suspension_cli.analyses.xcouple.solve import Coupling
from suspension_cli.drawing import curves, labels
from suspension_cli.drawing.added_points import add_points
from suspension_cli.drawing.style import house_style, new_figure
from suspension_cli.linear.response import Response
from suspension_cli.studies.job import Axis
from tests.support.golden import CONFIGS
from tests.support.legible import assert_legible, said
from tools.margins import set_margins


@pytest.fixture(scope="module")
def triple():
    return sus.read(CONFIGS / "geo-silica-triple.toml")


@pytest.mark.parametrize("loss", [0.0, 1e-6])
def test_phase_steps_at_poles_and_zeros_and_nowhere_else(loss):
    """Poles at 1 and 3, a zero at 2: lossless steps are those of a little loss, within a turn."""
    f = np.geomspace(0.1, 30, 501)
    square = f**2 * (1 - 1j * loss)
    value = (4 - square) / ((1 - square) * (9 - square))
    x, phase = curves.phase_line(f, value)
    for low, high, level in ((0, 0.9, 0), (1.1, 1.9, -180), (2.1, 2.9, 0), (3.2, 30, -180)):
        own = (x > low) & (x < high)
        assert phase[own] == pytest.approx(level, abs=0.1)


def test_a_phase_that_passes_half_a_turn_is_broken_there():
    turning = np.exp(-1j * np.linspace(0, 4 * np.pi, 200))
    x, phase = curves.phase_line(np.arange(200.0), turning)
    assert np.isnan(x).sum() == np.isnan(phase).sum() == 2
    assert np.nanmin(phase) >= -200 and np.nanmax(phase) < 160
    assert np.nanmax(np.abs(np.diff(phase))) < 10


@pytest.mark.parametrize(("top", "first"), [(10, "a"), (4, "↑ a")])
def test_labels_at_line_ends_keep_apart_and_point_beyond_the_limits(top, first):
    with house_style():
        figure = new_figure(5, 3)
        axes = figure.subplots()
        set_margins(figure, right=1.2)
        x = np.array([0.0, 1.0, 2.0])
        axes.set_xlim(0, 2)
        axes.set_ylim(0, top)
        levels = {"a": 5.0, "b": 3.0, "c": 3.01, "low": -50.0, "lower": -60.0}
        labels.label_ends(axes, [(x, level * x / 2, name, "k") for name, level in levels.items()])
    assert [text.get_text() for text in axes.texts] == [first, "b", "c", "↓ low", "↓ lower"]
    assert_legible(figure)


def test_peaks_are_found():
    f = np.geomspace(0.01, 100, 2000)
    size = 1 / np.abs(1 - f**2 + 1e-4j * f)
    assert f[curves.find_peaks(size)] == pytest.approx([1.0], rel=5e-3)


def test_peaks_are_those_of_scipy():
    rng = np.random.default_rng(0)
    for digits in (0, 1, 8):
        size = np.exp(2 * rng.normal(size=300)).round(digits) + 1e-3
        expected, found = signal.find_peaks(np.log(size), prominence=np.log(2))
        order = np.argsort(found["prominences"], kind="stable")
        assert curves.find_peaks(size).tolist() == expected[order].tolist()


def test_added_points_reach_a_tip_and_keep_the_grid():
    def pole(f):
        return (1 / (1 - f**2 + 1e-9j * f))[:, None, None]

    grid = np.geomspace(0.1, 10, 50)
    frequency, value = add_points(pole, grid, pole(grid), np.array([1.0001]))
    assert set(grid) <= set(frequency)
    assert np.abs(value).max() == pytest.approx(1e9, rel=0.05)
    assert len(frequency) < 400


def test_response_has_a_panel_per_unit_and_no_jump_of_phase(triple):
    found = sus.response(
        triple,
        inputs=["support.x"],
        outputs=["test.x", "test.pitch", "upper.x"],
        frequency="0.1:100:300",
        fidelity="beam",
    )
    figure = found.plot(scale="absolute")
    assert [axes.get_ylabel() for axes in figure.axes] == [
        "magnitude (m/m)",
        "magnitude (rad/m)",
        "phase (degrees)",
    ]
    assert "Transfer functions" in said(figure)
    assert "Triple pendulum with a fused-silica final stage · beam model" in said(figure)
    assert {"test.x / support.x", "0.552"} <= {*said(figure)}
    phase = figure.axes[2].lines[0].get_ydata()
    assert np.nanmax(np.abs(np.diff(phase))) < 100
    assert phase[-1] == pytest.approx(-180, abs=2)  # -540
    assert_legible(figure)
    assert len(found.frequency) == 300


@pytest.mark.filterwarnings("error")
def test_a_response_of_zero_is_said_to_be_zero(triple):
    found = sus.response(
        triple, inputs=["support.z"], outputs=["test.x"], frequency="0.1:100:30", fidelity="string"
    )
    figure = found.plot()
    assert "0 by symmetry at all frequencies" in said(figure)
    assert figure.axes[0].get_xlim() == (0.1, 100)


def test_response_without_loss_marks_its_peaks():
    def pole(f):
        return (1 / (1 - f**2) + 0j)[:, None, None]

    grid = np.geomspace(0.1, 10, 100)
    frequency, value = add_points(pole, grid, pole(grid), np.empty(0))
    signals = (("support.x",), ("test.x",), (("m/m",),))
    figure = draw_response(Response(frequency, *signals, value, 1), "A design")
    assert "1 Hz ∞" in said(figure)
    low, high = figure.axes[0].get_ylim()
    assert high - low < 200
    assert_legible(figure)


def test_sweep_names_what_moves_and_what_fails():
    """Pitch of the test mass and its pendulum mode mix where they come close."""
    vary = {"stage.test.wires.d": "-0.005:0.015:9"}
    found = sus.sweep(sus.example("double"), vary=vary, fidelity="string")
    figure = found.plot()
    (axes,) = figure.axes
    assert axes.get_xlabel() == "stage.test.wires.d (mm)"
    words = said(figure)
    assert {"unstable", "as designed: 1 mm", "grey: modes that change by less than 1 %"} <= {*words}
    (mixed,) = [w for w in words if w.startswith("a: ") and " mix: " in w]
    modes = mixed.removeprefix("a: ").partition(" mix")[0].split(" and ")
    assert {*modes} <= {*found.result}
    names = [line.get_label() for line in axes.lines]
    assert "test pitch" in names and "upper yaw" not in words
    assert_legible(figure)
    slack = {"perturbation.2.length_change": "-0.002:0.002:5"}
    found = sus.sweep(sus.example("imperfect"), vary=slack, fidelity="string")
    assert "slack" in said(found.plot())


def test_poles_of_control_by_frequency_and_q():
    """The damped ones are below the open ones; the title names the fastest that grows."""
    text = (CONFIGS / "triple-damped.toml").read_text()
    design = sus.parse(text.replace("gain = 1.0e6 ", "gain = -1.0e6 "))
    found = sus.damp(design, frequency="0.1:50:60", duration=5.0)
    figure = found.plot()
    lines = {line.get_label(): line for line in figure.axes[0].lines}
    opened, closed, growing = (lines[name] for name in ("open", "closed", "closed, grows"))
    poles = found.closed
    np.testing.assert_array_equal(growing.get_xdata(), poles.frequency[poles.growth_rate > 0])
    np.testing.assert_array_equal(growing.get_ydata(), -poles.q[poles.growth_rate > 0])
    assert np.median(closed.get_ydata()) < 1e-3 * np.median(opened.get_ydata())
    rate = found.closed.growth_rate
    where = found.closed.state[int(rate.argmax())]
    assert f"Local control UNSTABLE: {where} grows at {rate.max():.3g}/s" in said(figure)
    assert figure.axes[4].get_ylabel() == "phase (degrees)"


def test_coupling_over_frequency_is_that_of_the_worst_build_at_each():
    """And the headline is the highest point of its curve."""
    ratio = np.array([[1.0, 9.0, 1.0], [3.0, 2.0, 4.0], [2.0, 3.0, np.nan]]) + 0j
    axes = (Axis("k", (0.9, 1.0, 1.1)),)
    origin = sus.check(sus.template("single")).run
    found = Coupling(
        axes,
        np.array([1.0, 2.0, 4.0]),
        ratio,
        np.zeros(3),
        "test.1",
        "",
        "z",
        "a.x",
        "a.z",
        run=origin,
    )
    figure = draw_coupling(found, "Made up")
    worst, median = figure.axes[0].lines[:2]
    assert worst.get_ydata().tolist() == [3.0, 9.0, 4.0]
    assert median.get_ydata().tolist() == [2.0, 5.5, 2.5]
    assert "Cross-coupling: at most 9" in said(figure)
    assert "3 builds; largest at 2 Hz: k = 0.9" in said(figure)
