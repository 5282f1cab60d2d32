"""Pictures of all analyses: units, no overlap, nothing cut off, legible, and what they say."""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text

import suspension_cli as sus
from suspension_cli.analyses.fit.picture import draw_responses
from suspension_cli.analyses.fit.response_fit import ResponseFit
from tests.support.legible import misplaced, said

pytestmark = pytest.mark.usefixtures("full_resolution")

ROOT = Path(__file__).parents[2]
CONFIGS = ROOT / "configs"
COLUMN = 8.5 / 2.54
"""Width of a column, in."""
SMALLEST = 5.5
"""Smallest text where a picture is scaled to a column's width, points."""
PAGE = 17.8 / 2.54
"""Width of a page, in, for pictures with panels side by side."""
PAGES = {"map", "modes", "modes-pages", "draw-imperfect", "draw-wide", "damp", "damp-unstable"}
FREQUENCY = np.geomspace(0.1, 100, 50)
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
    return sus.optimise(double(), folder / "goals.toml", starts=1, fidelity="string")


def fitted_responses():
    """Figure of a fit to two measured resonances, with a point every 4 % of the frequency."""
    frequency = np.geomspace(0.4, 5.0, 60)
    before, after = (1 / (at**2 - frequency**2 + 0.05j * frequency) for at in (0.97, 1.02))
    noise = 1e-2 * np.exp(1j * np.arange(60.0) ** 2)
    nothing = np.empty(0)
    found = ResponseFit(
        ("x", "pitch"), ("coil-x", "coil-pitch"), ("osem-x", "osem-pitch"), ("m/V", "rad/V"),
        np.repeat([0, 1], 60), np.tile(frequency, 2), np.full(120, 1e-2),
        np.tile(after + noise, 2), np.tile(before, 2), np.tile(after, 2),
        (), nothing, nothing, nothing, (), np.empty((0, 6)),
    )  # fmt: skip
    return draw_responses(found, "Made up · beam model")


def measured():
    return sus.response(
        sus.read(ROOT / "measured/triple/triple.toml"),
        measured=[ROOT / "measured/triple/measured.toml"],
    )


def together():
    """Pictures of two stored results in one, as `plot --together` draws them."""
    stored = [
        sus.response(sus.example(name), frequency=FREQUENCY, fidelity="string")
        for name in ("quadruple", "ligo-quad-2005")
    ]
    return sus.compare(*stored)


CALLS = {
    "modes": lambda _: sus.modes(sus.example("geo-silica-triple"), fidelity="string"),
    "modes-pages": lambda _: sus.modes(sus.example("tower"), fidelity="string"),
    "modes-wires": lambda _: sus.modes(double(), max_frequency=500.0).figures()["-wires"],
    "draw-imperfect": lambda _: sus.draw(sus.example("imperfect")),
    "draw-wide": lambda _: sus.draw(sus.example("tower")),
    "response": lambda _: sus.response(double(), inputs=["support.x"], frequency=FREQUENCY),
    "responses": lambda _: sus.response(
        sus.example("geo-silica-triple"),
        inputs=["support.z", "upper.force_x"],
        outputs=["test.z", "upper.z", "test.pitch"],
        frequency=FREQUENCY,
        fidelity="string",
    ),
    "measured": lambda _: measured(),
    "thermal": lambda _: sus.thermal(sus.example("geo-silica-triple"), frequency=FREQUENCY),
    "budget": lambda _: sus.budget(double(), outputs=["test.x"], frequency=FREQUENCY),
    "budget-requirement": lambda _: sus.budget(
        sus.example("triple-damped"),
        outputs=["test.x", "test.pitch"],
        ground=["aligo-isi"],
        requirements=[f"test.x={ROOT}/goals/mirror-motion.csv"],
        frequency=FREQUENCY,
        fidelity="string",
    ),
    "compare-noise": lambda _: sus.compare(
        double(),
        sus.example("husman2000/table2"),
        inputs=["support.x"],
        outputs=["test.x"],
        noises=["test.x"],
        frequency=FREQUENCY,
        fidelity="beam",
    ),
    "together": lambda _: together(),
    "compare": lambda _: sus.compare(double(), sus.example("five-wires"), frequency=FREQUENCY),
    "sweep": lambda _: sus.sweep(
        double(), vary={"stage.test.wires.d": "-0.003:0.006:12"}, fidelity="string"
    ),
    "sweep-responses": lambda _: sus.sweep(
        double(),
        vary={"stage.test.wires.l": "0.2:0.5:7"},
        results=["test longitudinal", "test.x/support.x:10"],
        fidelity="string",
    ),
    "map": lambda _: sus.sweep(
        double(),
        vary={"stage.test.wires.d": "0.001:0.006:4", "stage.test.wires.l": "0.1:0.3:4"},
        fidelity="string",
    ),
    "xcouple": lambda _: sus.xcouple(
        double(), sweep={"k": "0.8:1.2:5", "offset": "-1e-3:1e-3:3"}, fidelity="string"
    ),
    "xcouple-frequency": lambda _: sus.xcouple(
        sus.example("husman2000/figure6"),
        sweep={"k": "0.9,1.1"},
        frequency=FREQUENCY,
        fidelity="string",
    ),
    "matrix": lambda _: sus.xcouple(sus.example("imperfect"), matrix=True, fidelity="string"),
    "tolerance": lambda _: sus.tolerance(
        sus.example("triple-tolerance"), builds=40, fidelity="string"
    ),
    "sensitivity": lambda _: sus.sensitivity(sus.example("geo-silica-triple"), fidelity="string"),
    "damp": lambda _: sus.damp(
        sus.example("triple-damped"), frequency=FREQUENCY, fidelity="string"
    ),
    "fit": lambda _: sus.fit(ROOT / "measured/husman2000/table1.toml", fidelity="string"),
    "optimise": optimise,
    "tolerance-roll": lambda _: sus.tolerance(
        sus.read(
            CONFIGS / "triple-tolerance.toml", ["tolerance.require.2.quantity=test static pitch"]
        ),
        builds=40,
        fidelity="string",
    ),
    "damp-unstable": lambda _: sus.damp(
        sus.read(
            CONFIGS / "triple-damped.toml",
            ["control.loop.x.gain=-800", "control.loop.yaw.gain=80000"],
        ),
        frequency=FREQUENCY,
        fidelity="string",
    ),
    "sensitivity-few": lambda _: sus.sensitivity(
        sus.example("imperfect"),
        results=["test pitch", "test.x@0,0,-0.001/test.z/support.z:50"],
        fidelity="string",
    ),
    "fit-responses": lambda _: fitted_responses(),
    "xcouple-peaks": lambda _: sus.xcouple(
        sus.example("triple-tolerance"),
        sweep={"k": "0.6,1.4", "offset": "-2e-3:2e-3:3"},
        frequency=np.geomspace(1, 100, 60),
        fidelity="string",
    ),
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
    figure.draw_without_rendering()
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


UNIT = re.compile(r"\((?!SI\b)[^()]+\)|\bin [A-Za-z%]+$|fraction|count|number|ratio|%|± .*[A-Za-z]")


@pytest.mark.filterwarnings("ignore::suspension_cli.PendsusWarning")
@pytest.mark.parametrize("name", CALLS)
def test_pictures_are_legible_and_have_units(name, folder):
    """Units on every axis, no overlapping or cut text, legible in a column."""
    assert find_faults(name, folder) == []


SAID = {
    "budget": "nearly all due to ground.x",
    "budget-requirement": r"the\srequirement\sis\s(met|exceeded)",
    "compare-noise": "relative to double",
    "sweep-responses": "test.x / support.x at 10 Hz",
    "fit": "8 numbers fitted to 24 modes in 4 experiments",
    "optimise": r"Optimised: \d of (\d) limits met, \d before",
    "xcouple": "Cross-coupling at 50 Hz: at most 0.00",
    "xcouple-frequency": "2 builds; largest at .* Hz: k = ",
    "xcouple-peaks": "6 builds; largest at 2.* Hz: k = ",
    "damp-unstable": "UNSTABLE: upper.yaw grows at .*/s",
    "sensitivity-few": r"test\.4 lower z\n",
    "fit-responses": r"drive\| \(m/V\)(.|\n)*drive\| \(rad/V\)",
    "tolerance-roll": r"for comparison: .*: coupling < 0\.001 at 50 Hz",
    "tolerance": r"of 40 builds meet all limits(?!(.|\n)*coupling < 0\.001)",
    "matrix": r"at 50 Hz, test \(rows\) per support \(columns\)",
}
"""Points that pictures make in words."""


@pytest.mark.filterwarnings("ignore::suspension_cli.PendsusWarning")
@pytest.mark.parametrize("name", SAID)
def test_pictures_say_their_point(name, folder):
    words = []
    for figure in figures(name, folder):
        words += said(figure)
        for axes in figure.axes:
            names = [label.get_text() for label in axes.get_yticklabels()]
            words += [axes.get_xlabel(), axes.get_ylabel(), *names, ""]
    assert re.search(SAID[name], "\n".join(words))


@pytest.mark.filterwarnings("ignore::suspension_cli.PendsusWarning")
def test_rows_are_listed_from_above(folder):
    """Modes of a comparison, the lowest first."""
    axes = figures("compare", folder)[0].axes[0]
    assert axes.get_yticklabels()[0].get_text().startswith("upper yaw") and axes.yaxis_inverted()


@pytest.mark.filterwarnings("ignore::suspension_cli.PendsusWarning")
def test_measured_points_stay_near_the_model(folder):
    """Three functions of the upper mass; arrows where points are outside."""
    (figure,) = figures("measured", folder)
    *magnitudes, phases, ratios = figure.axes
    lines = [line for axes in magnitudes for line in axes.lines if line.get_label() == "_model"]
    assert len(lines) == 3
    for model, points in zip(phases.lines[:3], phases.lines[3:6], strict=True):
        (x, y), (at, phase) = model.get_data(), points.get_data()
        known = np.isfinite(y)
        away = (phase - np.interp(at, x[known], y[known]) + 180) % 360 - 180
        assert np.median(np.abs(away[at < 3.5])) < 10
    low, high = ratios.get_ylim()
    drawn = [line for line in ratios.lines if line.get_marker() in "oD^v"]
    outside = sum(((y < low) | (y > high)).sum() for y in (line.get_ydata() for line in drawn))
    edge = sum(np.isin(line.get_ydata(), (low, high)).sum() for line in drawn)
    assert edge == outside > 0


def find_faults(name, folder):
    faults = []
    for figure in figures(name, folder):
        texts = seen_texts(figure)
        faults += misplaced(figure, [text for text, _ in texts], 0.025)
        faults += [
            f"line through: {text.get_text()}" for text, box in texts if _is_struck(text, box)
        ]
        for axes in figure.axes:
            faults += [f"no unit: {label!r}" for label in _labels(axes) if not UNIT.search(label)]
        scale = min((PAGE if name in PAGES else COLUMN) / figure.get_size_inches()[0], 1.0)
        small = {
            (text.get_text(), round(text.get_fontsize() * scale, 2))
            for text, _ in texts
            if text.get_fontsize() * scale < SMALLEST
        }
        faults += [f"small: {text}" for text in sorted(small)]
    return faults


def _is_struck(text, box):
    """Whether a line of the axes of a text without background passes through it."""
    axes = text.axes
    if axes is None or text.get_bbox_patch() or text.get_path_effects():
        return False
    middle, half = (box[2:] + box[:2]) / 2, np.maximum((box[2:] - box[:2]) / 2 - 2, 0.0)
    for line in axes.lines:
        points = line.get_transform().transform(np.asarray(line.get_xydata(), dtype=float))
        if line.get_clip_on():
            frame = np.reshape(axes.bbox.extents, (2, 2))
            points = np.clip(points, frame[0] - 1e3, frame[1] + 1e3)
        points = points[np.isfinite(points).all(1)]
        if len(points) < 2 or line.get_linestyle() == "None":
            continue
        start, step = points[:-1] - middle, np.diff(points, axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.stack([(-half - start) / step, (half - start) / step])
            low, high = ends.min(0), ends.max(0)
        beside = (step == 0) & (np.abs(start) >= half)
        low, high = np.where(step == 0, 0.0, low), np.where(step == 0, 1.0, high)
        if ((low.max(1, initial=0) < high.min(1, initial=1)) & ~beside.any(1)).any():
            clipped = line.get_clip_on() and not axes.bbox.contains(*middle)
            if not clipped:
                return True
    return False


def _labels(axes):
    """Labels of the axes with numbers."""
    for axis in (axes.xaxis, axes.yaxis):
        if not (axes.axison and axis.get_visible()):
            continue
        ticks = [label.get_text() for label in axis.get_ticklabels() if label.get_visible()]
        if any(re.fullmatch(r"[−\d.·]+([⁻⁰¹²³⁴-⁹]+)?", text) for text in ticks):
            shared = axes.get_shared_y_axes() if axis is axes.yaxis else axes.get_shared_x_axes()
            others = [
                (other.yaxis if axis is axes.yaxis else other.xaxis).get_label_text()
                for other in shared.get_siblings(axes)
            ]
            values = [text.get_text() for text in axes.texts if " ± " in text.get_text()]
            yield axis.get_label_text() or next(filter(None, [*others, *values]), "")
