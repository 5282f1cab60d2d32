"""House rules over the pictures of all analyses: units, no overlap, nothing cut off, legible."""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text

import suspension_cli as sus
from tests.support.legible import said

ROOT = Path(__file__).parents[2]
COLUMN = 8.5 / 2.54
"""Width of a column, in."""
SMALLEST = 5.5
"""Smallest text where a picture is scaled to a column's width, points."""
PAGE = 17.8 / 2.54
"""Width of a page, in, for pictures with panels side by side."""
PAGES = {"map", "modes", "modes-pages", "draw-imperfect", "draw-wide"}
FREQUENCY = np.geomspace(0.1, 100, 100)
GOALS = """
[[goal]]
kind = "band"
dof = ["x"]
at_least = 0.5
at_most = 5.0
[[free]]
name = "stage.test.wires.l"
lower = 0.1
upper = 1.0
[[free]]
name = "stage.test.wires.d"
lower = 0.0005
upper = 0.005
"""


def double():
    return sus.example("double")


def optimise(folder):
    (folder / "goals.toml").write_text(GOALS)
    return sus.optimise(double(), folder / "goals.toml", starts=1, model="string")


CALLS = {
    "modes": lambda _: sus.modes(sus.example("geo-silica-triple"), model="string"),
    "modes-pages": lambda _: sus.modes(sus.example("tower"), model="string"),
    "modes-wires": lambda _: sus.modes(double(), max_frequency=500.0).figures()["-wires"],
    "draw-imperfect": lambda _: sus.draw(sus.example("imperfect")),
    "draw-wide": lambda _: sus.draw(sus.example("tower")),
    "response": lambda _: sus.response(double(), inputs=["support.x"], frequency=FREQUENCY),
    "thermal": lambda _: sus.thermal(sus.example("geo-silica-triple"), frequency=FREQUENCY),
    "budget": lambda _: sus.budget(double(), outputs=["test.x"], frequency=FREQUENCY),
    "compare": lambda _: sus.compare(double(), sus.example("five-wires"), frequency=FREQUENCY),
    "sweep": lambda _: sus.sweep(
        double(), vary={"stage.test.wires.d": "-0.003:0.006:12"}, model="string"
    ),
    "map": lambda _: sus.sweep(
        double(),
        vary={"stage.test.wires.d": "0.001:0.006:4", "stage.test.wires.l": "0.1:0.3:4"},
        model="string",
    ),
    "xcouple": lambda _: sus.xcouple(
        double(), sweep={"k": "0.8:1.2:5", "offset": "-1e-3:1e-3:3"}, model="string"
    ),
    "xcouple-frequency": lambda _: sus.xcouple(
        sus.example("husman2000/figure6"),
        sweep={"k": "0.9,1.1"},
        frequency=FREQUENCY,
        model="string",
    ),
    "matrix": lambda _: sus.xcouple(sus.example("imperfect"), matrix=True, model="string"),
    "tolerance": lambda _: sus.tolerance(
        sus.example("triple-tolerance"), builds=40, model="string"
    ),
    "sensitivity": lambda _: sus.sensitivity(sus.example("geo-silica-triple"), model="string"),
    "damp": lambda _: sus.damp(sus.example("triple-damped"), frequency=FREQUENCY, model="string"),
    "fit": lambda _: sus.fit(ROOT / "measured/husman2000/table1.toml", model="string"),
    "optimise": optimise,
}


@cache
def figures(name, folder):
    result = CALLS[name](folder)
    return [result] if isinstance(result, Figure) else [*result.figures().values()]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("pictures")


def seen_texts(figure: Figure) -> list[tuple[Text, np.ndarray]]:
    """All texts that are drawn, and their boxes in pixels."""
    renderer = figure.canvas.get_renderer()
    figure.canvas.draw()
    hidden = {
        id(text)
        for axes in figure.axes
        for axis in (axes.xaxis, axes.yaxis)
        for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks())
        for text in (tick.label1, tick.label2)
        if not _is_shown(axes, axis, tick, text)
    }
    found = []
    for text in figure.findobj(Text):
        if id(text) in hidden or not text.get_visible() or not text.get_text().strip():
            continue
        if isinstance(text, Annotation) and not text._check_xy(renderer):
            continue
        box = Text.get_window_extent(text, renderer)
        found.append((text, np.array(box.extents)))
    return found


def _is_shown(axes, axis, tick, text):
    scale = axis.get_transform().transform
    low, high = np.sort(scale(axis.get_view_interval()))
    slack = 1e-9 * (high - low)
    return (
        axes.axison
        and axes.get_visible()
        and axis.get_visible()
        and tick.get_visible()
        and text.get_visible()
        and low - slack <= scale(tick.get_loc()) <= high + slack
    )


SI = re.compile(r"\bSI\b")
OFFSET = re.compile(r"[+−-]?\d*\.?\d*e[+−-]?\d+$")
"""A power of ten at the end of an axis as computers write it."""
UNIT = re.compile(r"\((?!SI\b)[^()]+\)|\bin [A-Za-z%]+$|fraction|count|number|ratio|%|± .*[A-Za-z]")


@pytest.mark.filterwarnings("ignore::suspension_cli.PendsusWarning")
@pytest.mark.parametrize("name", CALLS)
def test_pictures_keep_the_house_rules(name, folder):
    """Units on every axis, no overlapping or cut text, short legends, legible in a column."""
    assert find_faults(name, folder) == []


SAID = {
    "fit": "8 numbers fitted to 24 modes in 4 experiments",
    "optimise": r"Optimised: \d of (\d) limits met, \d before",
    "xcouple": "Cross-coupling at 50 Hz: at most .*10⁻",
    "xcouple-frequency": "largest at 100 Hz of 2 builds: k = 0.9",
    "matrix": r"at 50 Hz, test \(rows\) per support \(columns\)",
}
"""Points that pictures make in words."""


@pytest.mark.filterwarnings("ignore::suspension_cli.PendsusWarning")
@pytest.mark.parametrize("name", SAID)
def test_pictures_say_their_point(name, folder):
    (figure,) = figures(name, folder)
    assert re.search(SAID[name], "\n".join(said(figure)))


def find_faults(name, folder):
    faults = []
    for figure in figures(name, folder):
        texts = seen_texts(figure)
        faults += [f"outside: {text.get_text()}" for text, box in texts if _outside(box, figure)]
        boxes = np.array([box for _, box in texts])
        low = np.maximum(boxes[:, None, :2], boxes[None, :, :2])
        high = np.minimum(boxes[:, None, 2:], boxes[None, :, 2:])
        over = np.triu((high - low > 0.025 * figure.dpi).all(-1), 1)
        faults += [
            f"overlap: {texts[i][0].get_text()} / {texts[j][0].get_text()}"
            for i, j in np.argwhere(over)
        ]
        for axes in figure.axes:
            faults += [f"no unit: {label!r}" for label in _labels(axes) if not UNIT.search(label)]
            legend = axes.get_legend()
            if legend is not None and len(legend.get_texts()) > 8:
                faults.append(f"legend of {len(legend.get_texts())} rows")
        faults += [
            f"offset: {text.get_text()}" for text, _ in texts if OFFSET.match(text.get_text())
        ]
        faults += [f"(SI): {text.get_text()}" for text, _ in texts if SI.search(text.get_text())]
        scale = min((PAGE if name in PAGES else COLUMN) / figure.get_size_inches()[0], 1.0)
        small = {
            (text.get_text(), round(text.get_fontsize() * scale, 2))
            for text, _ in texts
            if text.get_fontsize() * scale < SMALLEST
        }
        faults += [f"small: {text}" for text in sorted(small)]
    return faults


def _outside(box, figure):
    return (box[:2] < -1).any() or (box[2:] > np.array(figure.bbox.size) + 1).any()


def _plain(text):
    return re.sub(r"\$\\mathdefault\{([^{}]*)\}\$", r"\1", text)


def _labels(axes):
    """Labels of the axes with numbers."""
    for axis in (axes.xaxis, axes.yaxis):
        if not (axes.axison and axis.get_visible()):
            continue
        ticks = [label.get_text() for label in axis.get_ticklabels() if label.get_visible()]
        if any(re.fullmatch(r"[−\d.]+|\$.*10\^.*\$", _plain(text)) for text in ticks):
            shared = axes.get_shared_y_axes() if axis is axes.yaxis else axes.get_shared_x_axes()
            others = [
                (other.yaxis if axis is axes.yaxis else other.xaxis).get_label_text()
                for other in shared.get_siblings(axes)
            ]
            values = [text.get_text() for text in axes.texts if " ± " in text.get_text()]
            yield axis.get_label_text() or next(filter(None, [*others, *values]), "")
