"""Pictures of results/: what they say, and that it can be read."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.drawing.style import house_style
from tests.support.legible import assert_legible, said
from tools import cavity, figure3, figure4, figure5, figure6
from tools.tradeoff import measurement, methods, page, picture
from tools.validation import comparison, ligo_production


def test_figure_3_has_the_printed_axes_and_both_limits():
    with house_style():
        figure = figure3.draw(figure3.solved())
    (axes,) = figure.axes
    assert (axes.get_xlim(), axes.get_ylim()) == ((1e-4, 0.1), (0.1, 100))
    assert axes.get_xlabel() == "separation $2s$ (m)"
    assert {"wires", "wires + cantilevers", "set by $d$: 0.295 Hz"} <= {*said(figure)}
    assert_legible(figure)


def test_figure_4_says_where_the_curve_leaves_the_printed_axis():
    with house_style():
        figure = figure4.draw(figure4.solved())
    (axes,) = figure.axes
    assert (axes.get_xlim(), axes.get_ylim()) == ((0, 0.12), (0, 9))
    assert "half the upper separation" in axes.get_xlabel()
    assert "↑ to 13.1 Hz at $t_1 = 0$" in said(figure)
    assert_legible(figure)


def test_figure_5_pairs_its_modes_with_those_of_table_2():
    answer, modes, _ = figure5.solved()
    for ours, printed in figure5.pair_modes(modes):
        assert ours == pytest.approx(printed, rel=0.01)
    with house_style():
        figure = figure5.draw(answer, modes)
    assert {
        "0.496 (0.5)",
        "3.62 (3.6)",
        "end of the paper's axis;\nwithout damping peaks have no end",
    } <= {*said(figure)}
    assert_legible(figure)


def test_figure_6_names_its_largest_ratios():
    with house_style():
        figure = figure6.draw([(hold, *figure6.ratios(hold)) for hold in figure6.HOLDS])
    assert {"loaded length held: up to 5.9 × 10⁻⁴", "−2 mm", "+2 mm"} <= {*said(figure)}
    for axes in figure.axes:
        assert axes.get_ylim() == pytest.approx((0, 6))
        drawn = [line for line in axes.lines if len(line.get_ydata()) > 100]
        assert len(drawn) == 5
        assert all(line.get_ydata().min() < 0.02 for line in drawn)
    assert_legible(figure)


def test_methods_for_a_response():
    """The program's own keeps its digits where a sum over modes loses them."""
    [double] = [file for file in methods.DESIGNS if file.stem == "double"]
    rows = methods.measure_methods(double)
    error = {row.method: row.error for row in rows}
    assert error[methods.OURS] < 1e-12 < 1e-11 < error["modal sum"]
    assert len(rows) == 2 * len(methods.METHODS)


def test_the_page_of_panels_and_its_text_follow_from_the_stored_table(tmp_path):
    """Titles say what the measurements show; writing and reading loses nothing."""
    rows = measurement.read_table(page.TABLE)
    (tmp_path / "copy.csv").write_text(measurement.write_table(rows))
    assert measurement.read_table(tmp_path / "copy.csv") == rows
    assert page.document(rows) == (page.FOLDER / "tradeoff.md").read_text()
    figure = picture.draw(rows)
    assert len(figure.axes) == 10
    assert_legible(figure)
    inch = figure.dpi
    renderer = figure.canvas.get_renderer()
    for text in figure.texts:  # none reaches into the panel beside it
        box = text.get_window_extent(renderer)
        if box.x0 < picture.WIDE * inch and text.get_position()[1] < 0.95:
            assert box.x1 < (picture.WIDE + 0.05) * inch, text.get_text()


def test_what_the_panels_claim_is_measured():
    """Elimination body by body has the smallest error; control variates gain with more builds."""
    rows = measurement.read_table(page.TABLE)
    worst = {
        name: picture.worst(own)
        for name, own in picture.by_method(measurement.select(rows, methods.WORK)).items()
    }
    assert min(worst, key=worst.get) == methods.OURS
    low = measurement.select(rows, picture.LOW, method="violin")
    assert all(row.error == 0 for row in low)


def test_a_comparison_counts_its_modes_and_draws_signed_deviations():
    """Against LIGO's production model, to which the design is fitted."""
    one = ligo_production.compare_with_production_model()
    figure = comparison.draw(one, ligo_production.SHOWN)
    assert "24 of 24 modes are within 0.1 % of LIGO's" in said(figure)
    modes, _, _ = figure.axes
    string, beam = modes.lines[:2]
    assert abs(string.get_ydata()).max() < 0.1
    assert np.sign(beam.get_ydata()).min() < 0 < np.sign(beam.get_ydata()).max()
    assert_legible(figure)


def test_the_picture_of_the_arm_counts_close_points_and_names_the_worst():
    """One of ten points deviates by -5 %."""
    frequency = np.geomspace(0.1, 100.0, 20)
    theirs = 1 / frequency[::2] ** 2
    ours = 1 / frequency**2
    ours[4] *= 0.95
    figure = cavity.draw_arm([cavity.Detuning("0 Hz", frequency, ours, frequency[::2], theirs)])
    assert "Optical spring: 90 % of points within 0.1 % of finesse" in said(figure)
    assert "largest: −5 %, at 0.43 Hz by a peak" in said(figure)
    assert_legible(figure)
