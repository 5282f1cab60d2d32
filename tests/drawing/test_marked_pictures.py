"""What pictures show where earlier ones misled: data over curves, ratios, ticks, names, files."""

from itertools import pairwise

import numpy as np
import pytest
from matplotlib.figure import Figure

import suspension_cli as sus
from suspension_cli.analyses.compare.picture import average_ratio
from suspension_cli.analyses.replaced_results import remove_old_pictures
from suspension_cli.drawing import curves, geometry, panels, style
from suspension_cli.drawing.panels import Across, Line, Panel


def resonance(frequency, at, q):
    return 1 / np.abs(at**2 - frequency**2 + 1j * at * frequency / q)


def test_averaged_ratios_do_not_depend_on_q():
    """Of a resonance that moves by 0.3 %: the ratio has spikes of about Q, its mean has none."""
    beside = np.geomspace(1e-9, 0.5, 3000)
    grid = np.unique(np.concatenate([at * (1 + s * beside) for at in (1, 1.003) for s in (-1, 1)]))
    means = []
    for q in (1e4, 1e6):
        ratio = resonance(grid, 1.003, q) / resonance(grid, 1.0, q)
        assert ratio.max() > 30
        means.append(average_ratio(grid, ratio))
        assert means[-1].min() > 0.8 and means[-1].max() < 1.25
    assert np.allclose(*means, rtol=2e-3)
    power = average_ratio(grid, 3 * grid**2)  # in the middle exact, of any power law
    inside = (grid > 0.6) & (grid < 1.4)
    assert np.allclose(power[inside], 3 * grid[inside] ** 2, rtol=1e-3)


def test_phases_of_loops_are_continuous():
    frequency = np.geomspace(0.1, 100, 400)
    delayed = np.exp(-0.02j * np.pi * frequency) / (1 + 1j * frequency) ** 3
    phase = curves.continuous_phase(delayed)
    expected = -3 * np.degrees(np.arctan(frequency)) - 3.6 * frequency
    assert np.allclose(phase, expected, atol=1e-6)
    low, high = curves.limit_phases([phase])
    assert low < expected.min() < expected.max() < high


def ticks(figure: Figure) -> list[float]:
    axes = figure.axes[0]
    low, high = axes.get_xlim()
    return [at for at in axes.get_xticks() if low <= at <= high]


@pytest.mark.parametrize("limits", [(-70.0, 90.0), (-9.0, 900.0), (-4000.0, 30.0)])
def test_signed_axes_are_labelled_near_their_ends(limits):
    line = Line(np.linspace(*limits, 9), np.arange(9.0))
    found = ticks(panels.draw("a", "b", [Panel("c (m)", [line])], Across("%", "signed", limits)))
    for end in limits:
        same_side = [at for at in found if at * end > 0]
        assert max(np.abs(same_side)) >= abs(end) / 10


@pytest.mark.parametrize("width", [1e-4, 0.06, 3.0, 1.2e5])
def test_labels_of_ticks_do_not_touch(width):
    line = Line(np.linspace(-width, width, 9), np.arange(9.0))
    across = Across("x (m)", "linear", (-width, width))
    figure = panels.draw("a", "b", [(Panel("c (m)", [line]), Panel("c (m)", [line]))], across)
    figure.draw_without_rendering()
    for axes in figure.axes:
        boxes = [
            text.label1.get_window_extent().extents
            for text in axes.xaxis.get_major_ticks()
            if -width <= text.get_loc() <= width
        ]
        assert len(boxes) > 1
        assert all(left[2] < right[0] for left, right in pairwise(boxes))


def test_shortened_names_keep_their_words():
    assert style.shorten("upper longitudinal#2", 18) == "upper longitudi…#2"


def test_a_turned_body_keeps_its_shape_from_above():
    corners = np.array([[1.0, 2.0, 0.0], [1.0, -2.0, 0.0], [-1.0, -2.0, 0.0], [-1.0, 2.0, 0.0]])
    c, s = np.cos(0.3), np.sin(0.3)
    turned = corners @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    sides = [
        np.linalg.norm(np.diff(geometry.ABOVE.see(one), axis=0), axis=1)
        for one in (corners, turned)
    ]
    assert np.allclose(*sides)


@pytest.mark.filterwarnings("ignore::suspension_cli.PendsusWarning")
def test_no_lines_where_a_sweep_is_unstable():
    found = sus.sweep(
        sus.example("double"), vary={"stage.test.wires.d": "-0.02:0.02:9"}, fidelity="string"
    )
    unstable = np.ravel(found.status) == 3
    assert 0 < unstable.sum() < 9
    lines = [line for line in found.plot().axes[0].lines if len(line.get_xdata()) == 9]
    assert lines and all(np.isnan(line.get_ydata()[unstable]).all() for line in lines)
    assert all(np.isfinite(line.get_ydata()[~unstable]).all() for line in lines)


def test_only_own_pictures_of_the_result_before_are_removed(tmp_path):
    figure = panels.draw("a", "b", [Panel("c (m)", [Line([1.0, 2.0], [1.0, 2.0])])])
    ours = style.encode(figure)
    stale = ("a-modes.png", "a-modes-2.png", "a-modes-wires.png")
    kept = ("a-modes-old.png", "b-a-modes.png", "a-response.png", "a-modes-3.png")
    for name in (*stale, *kept):
        (tmp_path / name).write_bytes(ours)
    (tmp_path / "a-modes-4.png").write_bytes(b"a photograph")
    said = []
    remove_old_pictures(tmp_path / "a-modes.h5", {tmp_path / "a-modes-3.png"}, said.append)
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {*kept, "a-modes-4.png"}
    assert len(said) == len(stale) and "a-modes-wires.png" in "\n".join(said)
