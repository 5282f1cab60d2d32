"""Rendering of figures to pixels, with every line of text drawn at once.

Matplotlib 3.11 draws text glyph by glyph, in half of the time of a picture with many labels.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg, RendererAgg, get_hinting_flag
from matplotlib.figure import Figure

from suspension_cli.scene.arrays import Array

BY_GLYPH = hasattr(RendererAgg, "_draw_text_glyphs_and_boxes")
"""Whether this Matplotlib draws text glyph by glyph."""


class _Renderer(RendererAgg):
    """Renderer that lays out horizontal text once, and draws it as one bitmap."""

    def __init__(self, width: float, height: float, dpi: float) -> None:
        super().__init__(width, height, dpi)
        self._laid_out: tuple[Any, ...] = ()

    def _lay_out(self, text: str, properties: Any) -> Any:
        """Return the font of properties with the text laid out in it."""
        key = text, hash(properties)
        if not self._laid_out or self._laid_out[:2] != key:
            font: Any = self._prepare_font(properties)
            font.set_text(text, 0.0, flags=get_hinting_flag())
            self._laid_out = *key, font
        return self._laid_out[2]

    def get_text_width_height_descent(
        self, s: str, prop: Any, ismath: Any
    ) -> tuple[float, float, float]:
        """Return width, height and descent of text, pixels."""
        if ismath or not BY_GLYPH:
            self._laid_out = ()
            return super().get_text_width_height_descent(s, prop, ismath)
        font = self._lay_out(s, prop)
        wide, high = font.get_width_height()
        return wide / 64, high / 64, font.get_descent() / 64

    def draw_text(
        self,
        gc: Any,
        x: float,
        y: float,
        s: str,
        prop: Any,
        angle: float,
        ismath: Any = False,
        mtext: Any = None,
    ) -> None:
        """Draw text whose baseline starts at a point, pixels from the upper left corner."""
        if ismath or angle or not BY_GLYPH:
            self._laid_out = ()
            super().draw_text(gc, x, y, s, prop, angle, ismath, mtext)
            return
        font = self._lay_out(s, prop)
        font.draw_glyphs_to_bitmap(antialiased=gc.get_antialiased())
        cover = np.asarray(font.get_image())[::-1]
        if not cover.size:
            return
        left, below = font.get_bitmap_offset()[0] / 64, font.get_descent() / 64
        colour, alpha = gc.get_rgb(), gc.get_alpha()
        if len(colour) > 3 and not gc.get_forced_alpha():
            alpha = colour[3]
        image = np.empty((*cover.shape, 4), np.uint8)
        image[..., :3] = np.round(255 * np.array(colour[:3]))
        image[..., 3] = cover if alpha == 1 else np.round(cover * alpha)
        self.draw_image(gc, round(x + left), round(self.height - y - below), image)


class _Canvas(FigureCanvasAgg):
    def get_renderer(self) -> RendererAgg:
        """Return a renderer of the size of the figure."""
        width, height = self.figure.bbox.size
        return _Renderer(width, height, self.figure.dpi)


def render(figure: Figure, dpi: float) -> Array:
    """Render a figure to pixels, uint8 (rows, columns, 4); its background is opaque."""
    before, old = figure.dpi, figure.canvas
    canvas = _Canvas(figure)
    figure.dpi = dpi
    canvas.draw()
    figure.dpi = before
    figure.set_canvas(old)
    return np.asarray(canvas.buffer_rgba())
