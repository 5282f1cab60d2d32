"""Pictures of results/: what they say, and that it can be read."""

from __future__ import annotations

import pytest

from suspension_cli.design import reader
from suspension_cli.drawing.style import house_style
from tests.support.legible import assert_legible, said
from tools import figure3, figure4, figure5, figure6, tradeoff


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
    """The program's own keeps its digits where a sum over modes loses them; all are named."""
    found = tradeoff.compare_methods(reader.example("double").design)
    error = {name: error for name, (_, error) in found.items()}
    assert error["pendsus: body by body"] < 1e-12 < 1e-11 < error["modal sum"]
    figure = tradeoff.draw_methods({"double": found}, {"double": "Double"})
    assert {"Double", *tradeoff.METHODS} <= {*said(figure)}
    assert_legible(figure)
