"""Sweeps over parameters: every point against a run of its own, modes followed by shape, what
fails, and that it does not matter how it is run."""

from __future__ import annotations

import itertools
import shlex
import tomllib

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.sweep import sharing
from suspension_cli.design import reader
from suspension_cli.files import mapped_arrays
from suspension_cli.linear import (
    eigenmodes,
    mode_pairing,
    response,
)
from suspension_cli.models import closed_form, registry
from tests.support import plants
from tests.support.commandline import MISSING, document, edited, run, strict_json, written
from tests.support.designs import overridden
from tests.support.exchanging import SMALL, D, pendulum_and_pitch, pitch
from tests.support.golden import CONFIGS

SINGLE = CONFIGS / "husman2000" / "table1-case2.toml"
TRIPLE = CONFIGS / "husman2000" / "table2.toml"


def swept(file, out, options):
    """The JSON document of a run that must succeed; options as one types them."""
    return document("sweep", file, "--workers", "1", "--out", out, *shlex.split(options))


def values(answer, name):
    """One result of a document."""
    [found] = [item for item in answer["results"] if item["name"] == name]
    return np.array(found["values"], dtype=float)


def size_of(model, frequency, into, over, under=None):
    """Magnitude of a response, or of the ratio of two."""
    outputs = plants.motions(model, over, *([under] if under else []))
    inputs = plants.drives(model, into)
    value = response.solve(model, np.array([frequency]), inputs, outputs).value[0, :, 0]
    return abs(value[0] / value[1] if under else value[0])


CASES = {
    "force": (
        TRIPLE,
        "force",
        {"stage.test.wires.t1": [0.05, 0.12], "stage.middle.blades.stiffness": [500.0, 900.0]},
    ),
    "string": (
        TRIPLE,
        "string",
        {"stage.test.wires.t1": [0.05, 0.12], "stage.middle.wires.d": [1e-3, 2e-3]},
    ),
    "closed form": (SINGLE, "closed-form", {"stage.test.wires.s": [0.01, 0.02, 0.03]}),
    "imperfect": (
        CONFIGS / "imperfect.toml",
        "string",
        {"perturbation.1.k_factor": [1.0, 1.1, 1.3]},
    ),
    "bent": (CONFIGS / "double.toml", "beam", {"stage.test.wires.radius": [1e-4, 2e-4, 3e-4]}),
    "dampers": (CONFIGS / "triple-damped.toml", "beam", {"constants.gravity": [9.7, 9.9]}),
    "five wires": (CONFIGS / "five-wires.toml", "beam", {"constants.gravity": [9.7, 9.9]}),
}


@pytest.mark.parametrize("case", CASES)
def test_points_are_the_designs_with_these_values(case):
    """Modes and a response of each point against its design alone."""
    file, level, vary = CASES[case]
    design = sus.read(file)
    motion = f"{design.stage[-1].name}.x"
    names = ["modes", f"{motion}/support.x:7"]
    found = sus.sweep(design, vary=vary, results=names, fidelity=level, workers=1)
    for place, values in zip(
        np.ndindex(found.status.shape), itertools.product(*vary.values()), strict=True
    ):
        alone = design.replace(dict(zip(vary, values, strict=True)))
        exact = eigenmodes.solve(registry.by_name(level).system(alone.design)).frequency
        np.testing.assert_allclose(np.sort(found.value[place][:-1]), exact, rtol=1e-9)
        ends = {"inputs": "support.x", "outputs": motion, "frequency": 7.0, "fidelity": level}
        size = abs(sus.response(alone, **ends).value.item())
        assert found.value[place][-1] == pytest.approx(size, rel=1e-8)


def test_modes_are_followed_through_a_crossing(tmp_path):
    """Yaw against t1 (equation 9) crosses longitudinal and transverse; its rank changes, its line
    does not."""
    vary = "--vary stage.test.wires.t1=0.002:0.13:60 --vary stage.test.wires.s=0.005,0.01"
    answer = swept(SINGLE, tmp_path, f"{vary} --fidelity force")
    t1 = np.linspace(0.002, 0.13, 60)
    for n, s in enumerate((0.005, 0.01)):
        raw = edited(tomllib.loads(SINGLE.read_text()), {("stage", 0, "wires", "s"): s})
        wires = closed_form.four_wires(reader.convert(raw))
        moved = closed_form.FourWires(
            wires.mass, wires.inertia, wires.l, s, t1, wires.t2, wires.d, wires.k, wires.gravity
        )
        expected = np.sqrt(closed_form.rotation(moved)) / (2 * np.pi)
        np.testing.assert_allclose(values(answer, "test yaw")[:, n], expected, rtol=1e-10)
        along = np.sqrt(moved.gravity / (moved.l * moved.cos)) / (2 * np.pi)
        np.testing.assert_allclose(values(answer, "test longitudinal")[:, n], along, rtol=1e-10)
        assert (np.diff(np.sign(expected - along)) != 0).sum() == 1, "the lines must cross"


def test_following_goes_round_holes():
    """Two modes that swap their ranks along each axis, with points missing."""
    angle = np.add.outer(np.linspace(0, 1, 9), np.linspace(0, 1, 7)) * np.pi / 2
    cos, sin = np.cos(angle), np.sin(angle)
    shapes = np.stack([np.stack([cos, sin], -1), np.stack([-sin, cos], -1)], -2)
    flipped = angle > 0.8  # ranks change where the frequencies cross
    shapes[flipped] = shapes[flipped][:, ::-1]
    squared = np.broadcast_to([1.0, 2.0], shapes.shape[:-1])
    good = np.ones((9, 7), dtype=bool)
    good[4, :6] = good[6, 2] = False
    rank, overlap = mode_pairing.follow(squared, shapes, good, (0, 0), np.eye(2))
    assert (rank[~good] == -1).all() and np.isnan(overlap[~good]).all()
    assert (rank[good] == np.where(flipped[good][:, None], [1, 0], [0, 1])).all()
    assert np.nanmin(overlap) > 0.9
    good[4, 6] = False  # now no way round: across the gap
    rank, overlap = mode_pairing.follow(squared, shapes, good, (0, 0), np.eye(2))
    assert (rank[good] == np.where(flipped[good][:, None], [1, 0], [0, 1])).all()


def test_a_near_miss_is_crossed_on_any_grid(tmp_path):
    """Tilt and longitudinal couple weakly through d; however fine the grid, tilt is tilt again past
    the longitudinal mode, and lines jump by 2 % at most."""
    for points in (30, 300):
        vary = f"--vary stage.test.wires.s=5e-5:0.05:{points}:log --fidelity force"
        answer = swept(CONFIGS / "husman2000" / "figure3.toml", tmp_path, vary)
        tilt, along = values(answer, "test pitch"), values(answer, "test longitudinal")
        assert tilt[0] < 0.3 and tilt[-1] > 40
        assert np.ptp(along) < 0.022 * along.mean()


def test_a_label_is_the_mode_that_is_mostly_that_motion(tmp_path):
    """Pitch and the pendulum mode exchange their character at d = I / m l = 0.86 mm, against a
    closed form. No frequency where pitch grows; both modes of the exchange are said and drawn."""
    grid = np.linspace(-1e-3, 3e-3, 41)
    file = written(tmp_path, SMALL)
    options = f"--vary {D}=-1e-3:3e-3:41 --result 'test pitch' --fidelity string --allow-unstable"
    answer = swept(file, tmp_path, options)
    expected = [pitch(d) for d in grid]
    np.testing.assert_allclose(values(answer, "test pitch"), expected, rtol=1e-7)
    [found] = answer["results"]
    fractions = [np.sort(pendulum_and_pitch(d)[1]) for d in grid]
    ours = np.transpose([found["other_fraction"], found["fraction"]])
    np.testing.assert_allclose(ours, fractions, atol=1e-7)
    exchange, growth = answer["remarks"]
    closest = min(range(41), key=lambda n: fractions[n][1])
    assert "two modes share this motion and exchange character between" in exchange
    assert f"{D} = {grid[closest]:.4g} they have" in exchange
    assert f"at {np.isnan(expected).sum()} of 41 points, {D} from -0.001 to " in growth


def test_pictures_show_both_modes_that_exchange_their_character(tmp_path):
    """The line of a label ends where another mode takes its motion over; both modes are drawn thin
    beneath it. As files have it, too."""
    vary = {D: np.linspace(-1e-3, 3e-3, 41)}
    found = sus.sweep(sus.parse(SMALL), vary=vary, results=["test pitch"], fidelity="string")
    found.save(tmp_path / "small.h5")
    axes = sus.load(tmp_path / "small.h5").plot().axes[0]
    lines = [line for line in axes.lines if len(line.get_xdata()) >= 41]
    thick = [line for line in lines if line.get_linewidth() > 1]
    thin = [line for line in lines if line.get_linewidth() < 1]
    assert len(thick) == 1
    assert len(thin) == 2
    grows = np.isnan([pitch(d) for d in vary[D]]).sum()
    y = np.asarray(thick[0].get_ydata())
    assert len(y) == 42
    assert np.isnan(y).sum() == grows + 1
    for line in thin:
        assert np.isnan(np.asarray(line.get_ydata())).sum() == grows


def test_modes_that_exchange_their_character_are_those_of_their_shapes(monkeypatch):
    """On a map read in blocks of one row: from the shapes of all points at once."""
    vary = {D: np.linspace(6e-4, 1.2e-3, 31), "stage.test.wires.l": np.linspace(0.19, 0.21, 4)}
    found = sus.sweep(sus.parse(SMALL), vary=vary, results=["test pitch"], fidelity="string")
    monkeypatch.setattr(mapped_arrays, "BLOCK", 1)
    [one] = sharing.labelled(found).values()
    mode = one.content.mode
    shape = np.array([[found.shape[i, j, mode[i, j]] for j in range(4)] for i in range(31)])
    overlap = np.einsum("ijc,ijc->ij", shape[1:], shape[:-1]) ** 2
    assert (one.exchanges(0) == (overlap < 0.5)).all()
    assert one.exchanges(0).sum(0).tolist() == [1, 1, 1, 1]  # once along d, at every length
    passed = np.argmax(one.exchanges(0), axis=0)
    assert one.exchanges(1).sum() == np.abs(np.diff(passed)).sum()
    other = found.omega_squared[3, 2, one.content.other[3, 2]]
    assert one.other[3, 2] == pytest.approx(np.sqrt(other) / (2 * np.pi))
    both = {found.rank[0, 0].tolist().index(n) for n in (mode[0, 0], one.content.other[0, 0])}
    assert set(one.curves) == both


def test_all_modes_are_followed_by_shape(tmp_path):
    """All at once, and one by its number: lines do not change places where modes do not cross."""
    options = f"--vary {D}=1e-5:3e-3:81 --result modes --result 'test pitch' --fidelity string"
    answer = swept(written(tmp_path, SMALL), tmp_path, options)
    names = [item["name"] for item in answer["results"]]
    followed = next(name for name in names if name.startswith("test pitch (mode "))
    own = values(answer, followed)
    assert np.abs(np.diff(own)).max() < 0.06, "the upper of two that do not cross"
    jumps = np.abs(np.diff(values(answer, "test pitch")))
    assert jumps.max() > 2 * np.abs(np.diff(own)).max()


def test_unstable_and_impossible_points_are_findings(tmp_path):
    options = "--vary stage.test.wires.d=-0.6:0.1:15 --result modes --result test.x/support.x:5"
    result = run("sweep", SINGLE, *options.split(), "--json", "--no-plot", "--out", tmp_path)
    assert result.exit_code == 0
    assert "points have no result: the equilibrium is unstable" in result.stderr
    answer = strict_json(result.stdout)
    yaw, tilt, pushed = (
        values(answer, name) for name in ("test yaw", "test longitudinal", "test.x/support.x:5")
    )
    assert np.isfinite(yaw).all(), "modes that do not grow have frequencies"
    assert np.isnan(pushed).sum() == answer["failures"]["the equilibrium is unstable"]
    assert (np.isnan(tilt) | np.isnan(values(answer, "test pitch")) | np.isfinite(pushed)).all()
    answer = swept(SINGLE, tmp_path, "--vary stage.test.wires.t1=0:0.5:11 --result 'test yaw'")
    reach = 0.133 + 0.26
    assert np.isnan(values(answer, "test yaw")).tolist() == [
        t1 >= reach for t1 in np.linspace(0, 0.5, 11)
    ]
    assert sum(answer["failures"].values()) == 3


def test_results_by_name(tmp_path):
    names = [
        "test pitch",
        "1",
        "test.x@0,0,0.001/support.x:10",
        "test.pitch/test.x/upper.force_x:2",
    ]
    requested = " ".join(f"--result '{name}'" for name in names)
    answer = swept(TRIPLE, tmp_path, f"--vary stage.test.wires.t2=0.08,0.09 {requested}")
    assert [(item["name"], item["unit"]) for item in answer["results"]] == [
        ("test pitch", "Hz"),
        ("upper yaw", "Hz"),
        (names[2], "1"),
        (names[3], "rad/m"),
    ]
    model = registry.by_name(answer["fidelity"]).system(
        overridden(TRIPLE.read_text(), {"stage.test.wires.t2": 0.09})
    )
    both = size_of(model, 2.0, "upper.force_x", "test.pitch", "test.x")
    assert values(answer, names[3])[1] == pytest.approx(both, rel=1e-12)
    shaken = size_of(model, 10.0, "support.x", "test.x@0,0,0.001")
    assert values(answer, names[2])[1] == pytest.approx(shaken, rel=1e-12)
    drawn = eigenmodes.solve(
        registry.by_name(answer["fidelity"]).system(reader.read(TRIPLE).design)
    )
    assert answer["results"][1]["nominal"] == pytest.approx(drawn.frequency[0], rel=1e-12)


def test_maps_name_the_value_of_a_third_parameter_and_label_contours_inside():
    vary = {
        "stage.test.wires.t1": (0.05, 0.12),
        "stage.test.wires.l": "0.1:1:3:log",
        "constants.gravity": (9.0, 10.0),
    }
    swept = sus.sweep(sus.read(SINGLE), vary=vary, results=["6"], fidelity="force")
    figure = swept.plot()
    figure.canvas.draw()
    assert "constants.gravity = 9 m/s^2" in figure.texts[1].get_text()
    axes = figure.axes[0]
    labels = [text for text in axes.texts if text.get_visible()]
    assert labels
    for label in labels:
        inner = label.get_window_extent()
        assert axes.bbox.x0 <= inner.x0 and inner.x1 <= axes.bbox.x1, label.get_text()


def test_a_coarse_grid_is_warned_of(tmp_path):
    """Where shapes change from point to point past recognition, that is reported."""
    path = "stage.middle.body.mass"
    for grid, warned in (("1,40", True), ("1:40:60:log", False)):
        options = f"--vary {path}={grid} --no-plot --workers 1 --fidelity force".split()
        result = run("sweep", TRIPLE, *options, "--out", tmp_path)
        assert result.exit_code == 0
        assert ("take a finer grid" in result.stderr) is warned


def test_auto_takes_the_model_that_the_results_need(tmp_path):
    """Bending shifts the pitch of a mirror by a quarter, its vertical mode hardly."""
    options = ("--vary", "stage.test.wires.d=1e-3,2e-3", "--json", "--out", tmp_path)
    pitch, vertical, loose, requested = (
        strict_json(run("sweep", CONFIGS / "double.toml", *options, *words).stdout)
        for words in (
            ("--result", "test pitch"),
            ("--result", "test vertical"),
            ("--result", "test pitch", "--tolerance", "0.9"),
            ("--result", "test pitch", "--fidelity", "force"),
        )
    )
    assert [one["fidelity"] for one in (pitch, vertical, loose)] == ["beam", "force", "force"]
    assert 0 < pitch["estimated_error"] < 1e-3 and 0 < vertical["estimated_error"] < 1e-3
    assert loose["estimated_error"] == requested["estimated_error"] > 0.1
    exact, crude = values(pitch, "test pitch"), values(requested, "test pitch")
    assert np.abs(crude / exact - 1).max() == pytest.approx(loose["estimated_error"], rel=0.01)


def test_what_no_model_has_is_reported(tmp_path):
    raw = edited(
        tomllib.loads((CONFIGS / "double.toml").read_text()),
        {("stage", n, "wires", "material"): MISSING for n in (0, 1)}
        | {("stage", n, "wires", "radius"): MISSING for n in (0, 1)}
        | {("stage", n, "wires", "k"): 1e4 for n in (0, 1)},
    )
    file = written(tmp_path, raw)
    result = run("sweep", file, "--vary", "stage.test.wires.d=1e-3,2e-3", "--out", tmp_path / "a")
    reason = "unknown: wire bending and wire mass, as wire upper.1 has no cross-section"
    assert result.stdout.splitlines()[0].endswith(reason)
    result = run(
        "sweep", file, "--vary", "stage.test.wires.d=1e-3,2e-3", "--json", "--out", tmp_path / "b"
    )
    answer = strict_json(result.stdout)
    assert answer["estimated_error"] is None and answer["error_unknown"].endswith(reason)


def test_slack_points_of_an_imperfect_design_leave_the_others_as_they_are():
    """Where only some of the points of a batch have modes, they are those of each point alone."""
    design, name = sus.example("imperfect"), "perturbation.2.length_change"
    both = sus.sweep(design, vary={name: "0,-0.002,0.0002"}, fidelity="string", workers=1)
    assert both.status.tolist() == [0, 1, 0]
    alone = sus.sweep(design, vary={name: "0,0.0002"}, fidelity="string", workers=1)
    assert np.isnan(both.value[1]).all()
    np.testing.assert_array_equal(both.value[[0, 2]], alone.value)
