"""`pendsus tradeoff`: JSON, text, results files, pictures and refusals."""

from __future__ import annotations

import itertools

import h5py
import numpy as np
import pytest
from matplotlib.text import Text

from suspension_cli.analyses import registry
from suspension_cli.analyses.tradeoff import file as files
from suspension_cli.analyses.tradeoff import headline, picture, summary, transfer_functions
from suspension_cli.analyses.tradeoff.command import NAMES, table
from suspension_cli.analyses.tradeoff.result import (
    COMPARED,
    KINDS,
    Entry,
    Omission,
    Panel,
    Tradeoff,
    View,
)
from suspension_cli.drawing.curves import COLUMN, SMALL
from suspension_cli.drawing.labels import annotate
from suspension_cli.drawing.style import add_axes, house_style, new_figure
from suspension_cli.files.hdf5 import open_results
from tests.support.commandline import (
    assert_refused,
    from_template,
    python,
    run,
    strict_json,
    written,
)
from tests.support.legible import assert_legible, said
from tests.support.paths import ROOT
from tests.support.quick_tradeoff import hurry

CASE = ROOT / "configs" / "husman2000" / "table1-case3.toml"
STEM = "husman2000-table1-case3-tradeoff"


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    """A folder with everything that a run writes, and what it says; its times are made up."""
    folder = tmp_path_factory.mktemp("out")
    with pytest.MonkeyPatch.context() as patch:
        hurry(patch)
        result = run("tradeoff", CASE, "--repeat", "2", "--json", "--out", folder)
    assert result.exit_code == 0, result.stderr
    (folder / "answer.json").write_text(result.stdout)
    return folder


@pytest.fixture(scope="module")
def answer(out):
    return strict_json((out / "answer.json").read_text())


@pytest.fixture(scope="module")
def found(out):
    with open_results(out / f"{STEM}.h5") as results:
        return files.load(results["tradeoff"])


def test_json(answer):
    assert list(answer) == [
        "command",
        "design",
        "repeat",
        "threads",
        "comparisons",
        "response_times",
        "answers",
    ]
    assert (answer["command"], answer["design"], answer["repeat"]) == (
        "tradeoff",
        "husman2000-table1-case3",
        2,
    )
    keys = [(item["quantity"], item["compares"]) for item in answer["comparisons"]]
    assert keys == [*itertools.product(NAMES[:-1], COMPARED), ("equilibrium", "methods")]
    for item in answer["comparisons"]:
        assert list(item) == [
            "quantity",
            "compares",
            "time",
            "item",
            "count",
            "reference",
            "entries",
            "left_out",
            "fronts",
        ]
        for entry in item["entries"]:
            assert list(entry) == [
                "model",
                "method",
                "error",
                "once_s",
                "batch_s",
                "once_relative",
                "batch_relative",
                "vectorised",
            ]
            assert entry["once_s"] == sorted(entry["once_s"]) and entry["batch_s"] == sorted(
                entry["batch_s"]
            )
        for kind in KINDS:
            assert min(entry[f"{kind}_relative"] for entry in item["entries"]) == 1.0
        assert all(
            list(front) == ["title", *KINDS] and front["once"] and front["batch"]
            for front in item["fronts"]
        )


def test_models_and_methods_are_compared_separately(answer):
    """Models against the top one, which is right to rounding; methods on one model; what does not
    hold is named with its reason."""
    for item in answer["comparisons"]:
        models = [entry["model"] for entry in item["entries"]]
        if item["compares"] == "models":
            assert len(set(models)) == len(models)
            (top,) = [entry for entry in item["entries"] if entry["model"] == "violin"]
            assert max(top["error"].values()) < 1e-12
            assert "violin" in item["reference"]
        else:
            assert len(set(models)) == 1
            assert "50 digits" in item["reference"]
        assert all(left["reason"] for left in item["left_out"])
    modes, _, response, *_ = answer["comparisons"]
    assert [entry["model"] for entry in modes["entries"]] == [
        "closed-form",
        "force",
        "string",
        "beam",
        "violin",
    ]
    assert list(modes["entries"][0]["error"]) == [
        "longitudinal-pitch",
        "transverse-roll",
        "vertical",
        "yaw",
    ]
    assert list(response["entries"][0]["error"]) == ["1 Hz", "10 Hz", "50 Hz", "100 Hz", "1 kHz"]


def test_results_file_has_all_of_the_json(answer, found, out):
    assert (found.repeat, len(found.panels)) == (2, len(answer["comparisons"]))
    for panel, item in zip(found.panels, answer["comparisons"], strict=True):
        assert (panel.quantity, panel.compares, panel.reference) == (
            item["quantity"],
            item["compares"],
            item["reference"],
        )
        for entry, reported in zip(panel.entries, item["entries"], strict=True):
            assert (
                dict(zip(panel.component, entry.error.tolist(), strict=True)) == reported["error"]
            )
            assert (entry.once.tolist(), entry.batch.tolist(), entry.vectorised) == (
                reported["once_s"],
                reported["batch_s"],
                reported["vectorised"],
            )
        assert [(left.model, left.method, left.reason) for left in panel.left] == [
            tuple(left.values()) for left in item["left_out"]
        ]
    with h5py.File(out / f"{STEM}.h5") as file:
        group = file["tradeoff/modes-models"]
        on = [
            str(name)
            for name, front in zip(group["entry"].asstr()[:], group["front_once"][0], strict=True)
            if front
        ]
        assert sorted(on) == sorted(answer["comparisons"][0]["fronts"][0]["once"])


def test_redraws_from_the_file_alone(tmp_path):
    """One comparison of models, one of methods."""
    with pytest.MonkeyPatch.context() as patch:
        hurry(patch)
        assert (
            run("tradeoff", CASE, "--quantity", "modes", "--out", tmp_path / "one").exit_code == 0
        )
    result = run("plot", tmp_path / "one" / f"{STEM}.h5", "--out", tmp_path / "other")
    assert result.exit_code == 0, result.stderr
    for name in (f"{STEM}{end}.png" for end in ("", "-models", "-methods-once", "-methods-batch")):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "other" / name).read_bytes()


def test_a_result_that_is_loaded_is_the_one_that_was_written(answer, found, out):
    with open_results(out / f"{STEM}.h5") as file:
        loaded = registry.loaded(file, "")
    assert loaded.document() == answer and str(loaded) == summary.text(found)


def test_numpy_reads_the_number_of_threads():
    """It is set before numpy is imported."""
    code = (
        "import os, sys; [os.environ.pop(f'{name}_NUM_THREADS', None) for name in ('OPENBLAS',"
        " 'OMP', 'MKL')];from suspension_cli.analyses.tradeoff.command import TradeoffAnalysis as"
        " T;T.read = lambda *_: sys.exit(f\"{'numpy' in sys.modules}"
        " {os.environ['OPENBLAS_NUM_THREADS']}\");from suspension_cli.cli.main import main;"
        " main(['tradeoff', 'x.toml'])"
    )
    assert python(code).stderr == "False 1\n"


def test_text(found):
    text = table(found)
    assert "median times of up to 2 samples" in text
    for panel in found.panels:
        compared = "models" if panel.compares == "models" else "methods"
        assert f"{panel.title}: {compared}\n" in text
    (line,) = [line for line in text.splitlines() if line.startswith("  closed-form, formulas")]
    assert " *" in line
    assert max(map(len, text.splitlines())) < 170


def test_summary(found, answer):
    """A headline and one line per question, each with the fastest that is accurate enough."""
    head, *lines = summary.text(found).splitlines()
    assert head.startswith("cheapest models within 0.1 % of violin: ") and "thermal noise" in head
    assert len([line for line in lines if line]) < 25 and max(map(len, lines)) < 130
    every = answer["answers"]
    assert len({(one["compares"], one["question"]) for one in every}) == len(every) == 17
    for one in every:
        panel = next(
            item
            for item in answer["comparisons"]
            if item["compares"] == one["compares"]
            and any(one["best"]["name"] in (e["model"], e["method"]) for e in item["entries"])
        )
        assert panel and sum(one["question"] in line for line in lines) >= 1
        limit = summary.MODEL_TOLERANCE if one["compares"] == "models" else 1e-9
        assert one["best"]["error"] <= limit
        if one["compares"] == "models" and one["other"]:
            assert one["other"]["error"] > limit and one["other"]["time_s"] < one["best"]["time_s"]


def test_summary_of_what_was_left_out():
    left = (Omission("violin", "dissipation", "nothing dissipates"),)
    panels = tuple(
        Panel("thermal", compares, "Thermal noise", "frequency", 5, "", "", (), (), left, ())
        for compares in COMPARED
    )
    assert summary.text(Tradeoff(panels, 2, 1)).splitlines() == [
        "no models to compare",
        "",
        "left out: thermal noise at 10 and 100 Hz: nothing dissipates",
    ]


def test_response_times(found, answer):
    models, methods = answer["response_times"]
    assert (models["compares"], methods["compares"]) == COMPARED
    assert methods["occasions"] == ["first", "same grid", "other grid"]
    assert methods["frequencies"] == [5, 200, 20_000]
    assert [entry["method"] for entry in methods["entries"]] == list(transfer_functions.METHODS)
    assert all(entry["error"] < 1e-9 for entry in methods["entries"])
    assert all(entry["error"] is None for entry in models["entries"])
    for each, item in zip(found.waits, answer["response_times"], strict=True):
        for entry, wanted in zip(each.entries, item["entries"], strict=True):
            assert np.shape(entry.time) == (3, 3, 3) and entry.time.tolist() == wanted["time_s"]
            assert entry.median("first", 200) == entry.time[0, 1, 1]


def test_details_only_if_requested(tmp_path, monkeypatch):
    hurry(monkeypatch)
    options = ("tradeoff", CASE, "--quantity", "equilibrium", "--no-plot", "--out", tmp_path)
    plain, verbose = run(*options), run(*options, "-v")
    assert "median times" not in plain.stderr and "median times" in verbose.stderr
    assert "no models to compare" in plain.stdout


def test_quantity_limits_what_is_compared(tmp_path, monkeypatch):
    hurry(monkeypatch)
    result = run(
        "tradeoff", CASE, "--quantity", "equilibrium", "--repeat", "2", "--json", "--out", tmp_path
    )
    assert result.exit_code == 0, result.stderr
    assert [item["quantity"] for item in strict_json(result.stdout)["comparisons"]] == [
        "equilibrium"
    ]
    assert [path.name for path in tmp_path.iterdir()] == [f"{STEM}.h5"]


def test_defaults_come_from_the_design(tmp_path, monkeypatch):
    hurry(monkeypatch)
    text = CASE.read_text() + '\n[analysis.tradeoff]\nrepeat = 3\nquantity = ["equilibrium"]\n'
    result = run("tradeoff", written(tmp_path, text), "--json", "--out", tmp_path / "out")
    assert result.exit_code == 0, result.stderr
    answer = strict_json(result.stdout)
    assert (answer["repeat"], len(answer["comparisons"])) == (3, 1)


def test_refusals(tmp_path):
    out, file = tmp_path / "out", from_template(tmp_path)
    (line,) = assert_refused(
        run("tradeoff", file, "--set", "stage.test.wires.d=-0.3", "--out", out), file, out
    )
    assert "unstable" in line and "--allow-unstable" not in line
    missing = tmp_path / "missing.toml"
    assert_refused(run("tradeoff", missing, "--out", out), missing, out)
    for options in (
        ["--repeat", "1"],
        ["--repeat", "many"],
        ["--quantity", "mode"],
        ["--fidelity", "beam"],
    ):
        result = run("tradeoff", file, *options, "--out", out)
        assert result.exit_code == 2
    assert not out.exists()


# Pictures of made-up numbers.


def made_up(compares="methods", count=6, seed=4):
    rng = np.random.default_rng(seed)
    entries = []
    for n in range(count):
        once, batch = (
            np.sort(10.0 ** rng.uniform(-6, -1) * rng.uniform(0.95, 1.05, 3)) for _ in KINDS
        )
        entries.append(
            Entry("string", f"method {n}", 10.0 ** rng.uniform(-15, 0, 2), once, batch, bool(n % 2))
        )
    left = (Omission("beam", "blocks", "wire test.1 has no cross-section"),)
    views = (View("All", (0, 1)),)
    return Panel(
        "modes",
        compares,
        "Modes",
        "design",
        9,
        "from here to there",
        "the truth",
        ("a", "b"),
        tuple(entries),
        left,
        views,
    )


def everything(panel):
    return Tradeoff((panel,), 2, 1)


@pytest.mark.parametrize(("compares", "seed"), [*itertools.product(COMPARED, range(2))])
def test_labels_do_not_overlap(compares, seed):
    """Every point has one; none lies on another or sticks out."""
    panel = made_up(compares, seed=seed)
    pages = picture.draw(everything(panel), "Made up").values()
    for axes in [axes for page in pages for axes in page.axes]:
        renderer = axes.figure.canvas.get_renderer()
        extents = {text.get_text(): text.get_window_extent(renderer) for text in axes.texts}
        assert {entry.name(compares) for entry in panel.entries} <= set(extents)
        for (one, a), (other, b) in itertools.combinations(extents.items(), 2):
            assert not a.overlaps(b), (seed, one, other)
        frame = axes.get_window_extent(renderer)
        for box in extents.values():
            assert (
                frame.x0 <= box.x0
                and box.x1 <= frame.x1
                and frame.y0 <= box.y0
                and box.y1 <= frame.y1
            )


def test_first_picture_gives_advice_with_the_points(found):
    """One chart per question; labels keep apart; the advice is that of the summary."""
    figure = headline.draw(found, "Made up")
    words = said(figure)
    assert_legible(figure)
    assert len(figure.axes) == 4
    for axes, (answer, options) in zip(figure.axes, summary.choices(found), strict=True):
        assert {option.name for option in options} < {text.get_text() for text in axes.texts}
        assert axes.get_xlabel() == "processor time (ms)"
        best = [line for line in axes.lines if line.get_markersize() > 8 and len(line.get_xdata())]
        assert [line.get_xdata()[0] for line in best] == [1e3 * answer.best.time]
        assert headline.advise(answer, options) in words
        assert answer in summary.answers(found)


def test_first_picture_says_what_was_left_out(found):
    """One chart and one reason, also where nothing else is compared."""
    modes = found.panels[0]
    reason = "nothing dissipates: give a loss angle, or a material that has one, to some wire"
    left = (Omission("violin", "dissipation", reason),)
    noise = Panel("thermal", "models", "Thermal noise", "frequency", 5, "", "", (), (), left, ())
    for panels, count in (((modes, noise), 1), ((modes,), 1)):
        figure = headline.draw(Tradeoff(panels, 2, 1), "Made up")
        assert len(figure.axes) == count
        assert_legible(figure)
        assert any(w.startswith("left out: nothing") for w in said(figure)) == (len(panels) > 1)


def test_pages_are_legible_in_a_column(found):
    """One column wide, each chart with the unit of its time, no text over another."""
    pages = picture.draw(found, "Made up")
    assert [*pages] == [*picture.PAGES]
    for figure in pages.values():
        assert figure.get_figwidth() == COLUMN
        assert_legible(figure)
        for axes in figure.axes:
            assert axes.get_xlabel().endswith(("(s)", "(ms)", "(µs)", "(ns)"))
        assert min(text.get_fontsize() for text in figure.findobj(Text)) >= SMALL
    said_once = said(pages["-methods-once"])
    assert any(text.endswith("first response, at 5 frequencies") for text in said_once)


def test_front_is_drawn_where_it_is():
    panel = made_up()
    (once,) = picture.draw(everything(panel), "Made up")["-methods-once"].axes
    size = {"one evaluation (ms)": 1e-3, "one evaluation (µs)": 1e-6}[once.get_xlabel()]
    time = np.array([entry.time("once") for entry in panel.entries]) / size
    worst = panel.worst(panel.views[0])
    corners = {
        (round(float(x), 9), round(float(y), 15))
        for line in once.lines
        for x, y in zip(*line.get_data(), strict=True)
        if len(line.get_xdata()) > 2
    }
    for n in panel.front("once", panel.views[0]):
        if worst[n] > 1e-12:
            assert (round(float(time[n]), 9), round(float(worst[n]), 15)) in corners


def test_labels_of_points_on_one_place():
    """Six points on one spot: labels fan out."""
    with house_style():
        figure = new_figure(4.0, 3.0)
        axes = add_axes(figure, 0.5, 0.3, 3.2, 2.3)
        axes.set_xlim(0, 1)
        axes.set_ylim(0, 1)
        texts = annotate(
            axes, [(0.5, 0.5)] * 6, [f"point {n}" for n in range(6)], ["black"] * 6, 7.0
        )
        boxes = [text.get_window_extent(figure.canvas.get_renderer()) for text in texts]
    assert not any(a.overlaps(b) for a, b in itertools.combinations(boxes, 2))


def test_picture_of_what_was_left_out_altogether():
    panel = made_up(count=0)
    nothing = Panel(
        "thermal", "models", "Thermal noise", "frequency", 5, "", "", (), (), panel.left, ()
    )
    figures = picture.draw(everything(nothing), "Made up")
    assert [*figures] == ["-models"] and figures["-models"].axes == []
    assert any(
        "left out: wire test.1 has no cross-section" in text.get_text()
        for text in figures["-models"].texts
    )


def test_table_of_the_tool(found):
    """The Markdown that `make tradeoff` writes has the numbers of the results."""
    from tools import tradeoff as tool

    name = "husman2000-table1-case3"
    lines = tool.overview("modes-models", "Mode frequencies", {name: found})
    assert lines[2].startswith("| design | closed-form | force | string | beam | violin |")
    (row,) = [line for line in lines if line.startswith(f"| {name}")]
    assert row.count("|") == 7 and "1 / 1" in row
    text = "\n".join(line for panel in found.panels for line in tool.full(panel))
    assert "| closed-form, formulas | **1** (" in text
