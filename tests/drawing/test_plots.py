"""Pictures: every mode and dimension is there and legible, files whole or absent."""

import io
import os

import numpy as np
import pytest
from matplotlib.text import Text
from PIL import Image

import suspension_cli as sus
from suspension_cli.analyses.modes import picture as modes
from suspension_cli.drawing import draw, labels, style
from suspension_cli.equilibrium.nominal import expand
from tests.support.legible import assert_legible
from tests.support.legible import said as texts
from tests.support.pictures import DESIGNS, SINGLE, TRIPLE, made, solved

pytestmark = pytest.mark.usefixtures("full_resolution")


# pictures


@pytest.mark.parametrize("name", DESIGNS)
def test_every_mode_has_its_panel(name):
    design, scene, found = solved(DESIGNS[name])
    pages = modes.draw_pages(found, design, scene, "title and model")
    assert sorted(n for page in pages for n in page.numbers) == list(range(len(found.frequency)))
    said = [text for page in pages for text in texts(page.figure)]
    assert "title and model" in said
    for n, frequency in enumerate(found.frequency):
        assert modes.format_heading(found, n) in said
        assert (
            modes.format_heading(found, n)
            == f"{n + 1}  {style.format_significant(float(frequency))} Hz"
        )
    assert sum(text in ("side on", "face on", "from above") for text in said) == len(
        found.frequency
    )
    for page in pages:
        assert_legible(page.figure)


def test_the_largest_fraction_comes_first_under_a_mode():
    design, scene, found = solved(SINGLE)
    n = int(np.argmin(found.fractions.max(1)))
    (page,) = modes.draw_pages(found, design, scene, "")
    said = texts(page.figure)
    first = said[said.index(modes.format_heading(found, n)) + 2]
    assert first == f"{found.label[n]} {100 * found.fractions[n].max():.0f} %"


@pytest.mark.parametrize("name", DESIGNS)
def test_a_drawing_names_every_body_and_its_mass(name):
    design, scene = made(DESIGNS[name])
    figure = draw.draw(design, scene)
    said = texts(figure)
    for stage, mass in zip(design.stage, scene.bodies.mass, strict=True):
        assert style.single_line(stage.name, 18) in said and f"{mass:.4g} kg" in said
    assert "SIDE ON" in said and "FACE ON" in said
    assert_legible(figure)


def test_both_views_of_a_drawing_have_one_scale():
    figure = draw.draw(*made(TRIPLE))
    views = [axes for axes in figure.axes if axes.get_xlabel()]
    assert [axes.get_xlabel() for axes in views] == ["x (m)", "y (m)"] and views[
        0
    ].get_ylabel() == "z (m)"
    scales = []
    for axes in views:
        box = axes.get_window_extent()
        scales += [box.width / np.ptp(axes.get_xlim()), box.height / np.ptp(axes.get_ylim())]
    assert scales == pytest.approx([scales[0]] * 4)


def test_a_drawing_has_the_dimensions():
    said = texts(draw.draw(*made(SINGLE)))
    for text in ("$l$ = 400 mm", "$s$ = 25 mm", "$t_2$ = 133 mm", "$d$ = 32 mm"):
        assert text in said
    said = texts(draw.draw(*made(TRIPLE)))
    assert (
        "$d_u$ = 3 mm" in said
        and "$t_1$ = $t_2$ = 96.5 mm" in said
        and "10 / 5" in said
        and "2 × 1500" in said
    )


def test_spread_keeps_order_and_gap_and_moves_no_more_than_needed():
    assert labels.spread([0.0, 1.0, 2.0], 0.5) == pytest.approx([0.0, 1.0, 2.0])
    assert labels.spread([1.0, 1.0], 0.4) == pytest.approx([0.8, 1.2])
    found = labels.spread([0.3, 0.0, 0.1, 5.0, 0.2], 0.5)
    assert np.diff(np.sort(found)).min() >= 0.5 - 1e-12 and found[3] == 5.0
    assert np.argsort(found).tolist() == [1, 2, 4, 0, 3]
    bounded = labels.spread([0.0, 0.1, 9.0, 9.9], 1.0, 0.0, 10.0)
    assert bounded == pytest.approx([0.0, 1.0, 8.95, 9.95])


# files


def test_a_png_has_the_pixels_of_the_canvas():
    figure = style.new_figure(4.6, 1.3)  # 4.6 x 180 is 827.99...
    style.write_text(figure, 0.1, 0.1, "text", colour="#0072b2")
    stream = io.BytesIO(style.encode(figure))
    image = Image.open(stream).convert("RGB")
    reference = io.BytesIO()
    with style.house_style():
        figure.savefig(reference, format="png", dpi=style.DPI)
    assert (np.asarray(image) == np.asarray(Image.open(reference).convert("RGB"))).all()
    assert Image.open(stream).info["Software"] == "pendsus"
    assert Image.open(stream).info["dpi"][0] == pytest.approx(style.DPI, 1e-3)


def test_save_leaves_nothing_behind_when_it_fails(tmp_path, monkeypatch):
    path = tmp_path / "a.png"
    path.write_text("old")
    figure = style.new_figure(1, 1)

    def broken(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(figure, "draw", broken)
    with pytest.raises(OSError, match="No space left"):
        style.save(figure, path)
    assert path.read_text() == "old" and os.listdir(tmp_path) == ["a.png"]


def test_the_dimensions_of_every_set_of_wires_stand_beside_the_views():
    design = sus.example("ligo-quad-2005").design
    figure = draw.draw(design, expand(design))
    side, face = (axes for axes in figure.axes if axes.get_xlabel())
    boxes = {
        one.get_text(): one.get_window_extent(figure.canvas.get_renderer())
        for one in figure.findobj(Text)
    }
    for stage in design.stage:
        assert boxes[f"$l$ = {style.length(stage.wires.l)}"].x0 > face.bbox.x1
        assert boxes[f"$d$ = {style.length(stage.wires.d)}"].x1 < side.bbox.x0
