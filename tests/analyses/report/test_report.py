"""The report of a design: one file that is whole, valid HTML, and says what its analyses say."""

from __future__ import annotations

import base64
import io
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
from html.parser import HTMLParser

import pytest

import suspension_cli as sus
from suspension_cli.analyses import tables
from suspension_cli.analyses.report import page as pages
from tests.support.commandline import run
from tests.support.paths import CONFIGS

QUICK = ("--fidelity", "string", "-q")
VOID = {"meta", "link", "img", "br", "hr"}


class Page(HTMLParser):
    """What a test asks of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []
        self.images: list[dict[str, str | None]] = []
        self.headings: list[int] = []
        self.tags: set[str] = set()
        self.text = ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.tags.add(tag)
        if tag not in VOID:
            self.open.append(tag)
        self.ids += [given["id"]] if "id" in given else []
        self.links += [given[name] for name in ("href", "src") if name in given]
        self.images += [given] if tag == "img" else []
        self.headings += [int(tag[1])] if re.fullmatch("h[1-6]", tag) else []

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A report of a damped design with an imperfection, on the quickest model."""
    folder = tmp_path_factory.mktemp("report")
    text = (CONFIGS / "double.toml").read_text() + LOOP
    file = folder / "double.toml"
    file.write_text(text)
    words = ("--fidelity", "beam", "-q", "--input", "support.x")
    done = run("report", file, "--out", folder, *words)
    assert done.exit_code == 0, done.stderr
    return folder / "double-report.html"


LOOP = """
[[control.loop]]
name = "x"
sensor = "upper.x"
actuator = "upper.force_x"
gain = 1e5
zeros = [0.0]
poles = [20.0, 20.0]
[[perturbation]]
wire = "test.1"
upper_offset = [1e-4, 0.0, 0.0]
"""


@pytest.fixture(scope="module")
def page(written):
    return Page(written.read_text(encoding="utf-8"))


def test_page_stands_alone(page):
    """No script, nothing from outside, every link leads somewhere."""
    assert not page.tags & {"script", "iframe", "object", "embed"}
    for link in page.links:
        assert link.startswith(("data:", "#")), link
        assert not link.startswith("#") or link[1:] in page.ids


def test_pictures_are_valid_and_described(page):
    assert len(page.images) >= 6
    for image in page.images:
        assert image["alt"]
        kind, data = re.fullmatch("data:image/(svg[+]xml|png);base64,(.*)", image["src"]).groups()
        whole = base64.b64decode(data, validate=True)
        if kind == "png":
            assert whole.startswith(b"\x89PNG")
        else:
            root = ET.parse(io.BytesIO(whole)).getroot()
            assert root.tag.endswith("svg")
            ratio = float(root.get("width")[:-2]) / float(root.get("height")[:-2])
            assert ratio == pytest.approx(int(image["width"]) / int(image["height"]), rel=0.01)


def test_the_design_keeps_its_comments(page, written, tmp_path):
    text = written.with_name("double.toml").read_text()
    assert "#" in text and text.rstrip() in page.text
    (link,) = [link for link in page.links if link.startswith("data:application/toml")]
    assert base64.b64decode(link.partition(",")[2]).decode() == text
    file, change = written.with_name("double.toml"), "stage.test.wires.d=0.003"
    done = run("report", file, "--sections", "numbers", "--set", change, "--out", tmp_path, "-q")
    assert done.exit_code == 0
    (made,) = tmp_path.iterdir()
    assert "d = 0.003" in Page(made.read_text(encoding="utf-8")).text


def test_noises_of_several_mirrors(tmp_path):
    words = ("--sections", "thermal,budget", "--arm", "4000", "--mirrors", "4", "--out", tmp_path)
    done = run("report", CONFIGS / "husman2000" / "figure6.toml", *words, "--fidelity", "beam")
    assert done.exit_code == 0
    (made,) = tmp_path.iterdir()
    text = Page(made.read_text(encoding="utf-8")).text
    assert "test.x along a beam that rises by 314 urad, 4 mirrors: thermal noise" in text
    assert "test.x along a beam that rises by 314 urad, 4 mirrors, 0.01 to 100 Hz" in text
    assert text.count("--fidelity beam --arm 4000.0 --mirrors 4.0") == 2


def test_says_what_it_is_of(page, written):
    text = page.text
    assert f"pendsus {sus.__version__}" in text
    assert str(written.with_name("double.toml")) in text
    assert "upper_offset" in text  # the design
    assert "Not computed" not in text
    assert "Left out, as the design has no [tolerance] table" in text
    assert f"pendsus modes {written.with_name('double.toml')} --fidelity beam" in text


def test_modes_are_those_of_the_command(page):
    """The same columns as the table in the terminal."""
    design = sus.parse((CONFIGS / "double.toml").read_text() + LOOP)
    found = sus.modes(design, fidelity="beam")
    for name, frequency in zip(found.label, found.frequency, strict=True):
        assert f"{frequency:#.5g}" in page.text
        assert name.rpartition(" ")[2] in page.text


def test_unstable_design_says_why(tmp_path):
    done = run(
        *("report", CONFIGS / "double.toml", "--out", tmp_path, *QUICK),
        *("--set", "stage.test.wires.d=-0.05", "--sections", "modes, response,check"),
        *("--name", "double"),
    )
    assert done.exit_code == 0
    page = Page((tmp_path / "double-report.html").read_text())
    assert page.ids == ["check", "modes", "response", "provenance", "design"]
    assert re.search(
        "Not computed: stage: the equilibrium is unstable: .* 1/s; attach the wires", page.text
    )
    assert re.search(r"stage: the equilibrium is unstable in the \w+ model: .* 1/s", page.text)
    assert "--allow-unstable" not in page.text
    assert "Responses not computed" in done.stderr


def test_same_bytes_again(tmp_path):
    design = sus.example("double")
    path = tmp_path / "a.html"
    first = sus.report(design, path, sections=["drawing", "check"])
    assert path.read_bytes() == first.page.encode()
    assert sus.report(design, path, sections=["drawing", "check"]).page == first.page
    assert [one.name for one in tmp_path.iterdir()] == ["a.html"]


def test_record_says_what_is_in_the_page(tmp_path):
    """Also without the page: what was left out, commands and models, verdicts on requirements."""
    limits = [{"quantity": "test pitch", "at_most": 0.1}, {"quantity": "test yaw", "at_most": 9.0}]
    design = sus.example("double").replace({"requirement": limits})
    sections = ["check", "modes", "tolerance"]
    made = sus.report(design, tmp_path / "a.html", sections=sections, fidelity="string")
    assert (made.path, made.title) == (tmp_path / "a.html", design.title)
    assert [one.name for one in made.sections] == sections
    check, modes, tolerance = (one.missing for one in made.sections)
    assert not check and not modes and "no [tolerance] table" in tolerance
    assert [(one.title, one.model) for one in made.parts] == [
        ("Requirements", ""),
        ("Modes", "string"),
    ]
    assert [one.met for one in made.verdicts] == [False, True]
    text = "1 of 2 requirements is NOT met.\nTolerances: Left out, as the design has no"
    assert str(made).startswith(text)
    document = made.document()
    assert [one["met"] for one in document["requirements"]] == [False, True]
    assert [one["name"] for one in document["sections"]] == sections and len(document["parts"]) == 2
    with pytest.raises(sus.InputError, match="a report has no labelled arrays"):
        made.to_xarray()


def test_tolerances_are_read_if_computed_before(tmp_path):
    config = CONFIGS / "triple-tolerance.toml"
    words = ("--out", tmp_path, *QUICK, "--builds", "100")
    assert run("tolerance", config, *words, "--no-plot", "--workers", "1").exit_code == 0
    assert run("report", config, *words, "--sections", "tolerance").exit_code == 0
    text = Page((tmp_path / "triple-tolerance-report.html").read_text()).text
    assert "Read from triple-tolerance-tolerance.h5" in text
    assert "100 of 100 builds hang on taut wires" in text


def cells(columns, rows):
    """Text of the cells of a table, by row."""
    made = pages.table(tables.Table(columns, rows))
    return [[cell for _, cell in row] for row in made.rows]


def test_tables_have_readable_numbers():
    columns = {"name": "", "Q": ".4g", "noise\nm/sqrt(Hz)": ".2e", "x": ".1f"}
    rows = [("a <b> 3 %", 6762, 1.25e-21, None), ("c", 3.074e5, 2e-9, -2.5)]
    assert cells(columns, rows) == [
        ["a <b> 3\u00a0%", "6762", "1.25×10⁻²¹", "-"],
        ["c", "3.074×10⁵", "2.00×10⁻⁹", "−2.5"],
    ]


def test_text_of_the_design_is_escaped(tmp_path):
    title = "a <b>&amp; +- 1 m/sqrt(Hz)\u202e"
    design = sus.example("double").replace({"design.title": title})
    text = sus.report(design, tmp_path / "a.html", sections=["numbers"]).page
    assert "<b>" not in text and "\u202e" not in text
    assert "a <b>&amp; ± 1 m/√Hz\\u202e" in Page(text).text


def test_numbers_are_aligned_on_the_point():
    """By spaces as wide as a digit."""
    found = cells({"x": "#.4g"}, [(0.1234,), (123.4,), (12.34,)])
    assert [cell.replace("\u2007", " ") for (cell,) in found] == ["0.1234", "123.4   ", "12.34  "]


CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
PROBE = """<script>
const broken = [];
addEventListener("error", e => broken.push("error " + e.message));
addEventListener("load", () => {
  for (const img of document.images)
    if (!img.complete || !img.naturalWidth) broken.push("image " + img.alt);
  const wide = document.documentElement.scrollWidth > innerWidth ? ["page too wide"] : [];
  const found = [document.images.length, ...broken, ...wide].join("|");
  document.body.setAttribute("data-found", found);
});
</script></head>"""
"""Added to a copy of the page: reports what the browser could not show."""


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium is installed (Debian package chromium)")
def test_opens_in_a_browser_without_network(page, written, tmp_path):
    probe = tmp_path / "probe.html"
    probe.write_text(written.read_text(encoding="utf-8").replace("</head>", PROBE))
    done = subprocess.run(
        [
            *(CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--dump-dom"),
            *("--enable-logging=stderr", "--window-size=1000,800"),
            *("--virtual-time-budget=10000", "--host-resolver-rules=MAP * ~NOTFOUND"),
            *(f"--user-data-dir={tmp_path / 'profile'}", probe.as_uri()),
        ],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    found = re.search('data-found="(.*?)"', done.stdout)
    assert found is not None, done.stderr[-2000:]
    assert found[1] == str(len(page.images))
    assert "CONSOLE" not in done.stderr


REQUIRED = """
[[requirement]]
quantity = "lowest pitch"
at_most = 0.9
note = "design document, 4.2"
[[requirement]]
quantity = "tension test.1"
at_most = 10.0
"""


def test_the_first_page_is_for_a_design_review(tmp_path, monkeypatch):
    """Author, date, notes, yields, what was optimised, the model and its error, and the drawing."""
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1000000000")
    notes = 'author = "A & B"\nnotes = """\nFirst <b>version</b>.\n\nClamps are open."""\n'
    text = sus.template("single").text.replace("[design]\n", f"[design]\n{notes}")
    text += '[[requirement]]\nquantity = "test pitch"\nat_most = 20.0\n'
    text += '[[tolerance.body]]\nstage = "test"\ncom = { normal = 1e-4 }\n'
    goals = tmp_path / "goals.toml"
    goals.write_text('[[free]]\nname = "stage.test.wires.d"\nlower = 1e-4\nupper = 2e-3\n')
    found = sus.optimise(sus.parse(text), goals, fidelity="string")
    found.save(tmp_path / "single-optimise.h5")
    quick = {"fidelity": "string", "builds": 100, "sections": "drawing,modes,tolerance"}
    sus.report(found.design, tmp_path / "page.html", **quick)
    page = Page((tmp_path / "page.html").read_text(encoding="utf-8"))
    first = "".join(page.text.partition("Provenance")[0].split())
    for words in (
        "Author A & B Date 9 September 2001",
        "First <b>version</b>. Clamps are open.",
        "The requirement is met.",
        "Yield of 100 random builds: ",
        "Optimised for goals.toml parameter unit before after stage.test.wires.d m 0.00100000 ",
        "To scale, from the side and from the front: 5.6 kg in all.",
        "Modes: model: string (as requested); neglected: wire bending",
    ):
        assert "".join(words.split()) in first, words


def test_requirements_stand_on_the_first_page(tmp_path):
    """Before the contents, with value, margin and limit as `check` prints them."""
    file = tmp_path / "double.toml"
    file.write_text((CONFIGS / "double.toml").read_text() + REQUIRED)
    done = run("report", file, "--out", tmp_path, "--sections", "numbers", "-q")
    assert done.exit_code == 0, done.stderr
    text = (tmp_path / "double-report.html").read_text()
    page = Page(text)
    assert "requirements" in page.ids
    assert text.index('id="requirements"') < text.index("<nav")
    assert "1 of 2 requirements is NOT met." in page.text
    for verdict in sus.check(sus.read(file)).verdicts:
        assert verdict.requirement.description in page.text
        unit, factor = verdict.requirement.displayed
        assert f"{verdict.value * factor:.5g} {unit}" in page.text
        assert pages.number(100 * verdict.margin) in page.text
    assert "lowest pitch: design document, 4.2" in page.text


def test_an_unknown_quantity_is_said_on_the_first_page(tmp_path):
    file = tmp_path / "double.toml"
    wrong = REQUIRED.replace("lowest pitch", "lowest pich")
    file.write_text((CONFIGS / "double.toml").read_text() + wrong)
    done = run("report", file, "--out", tmp_path, "--sections", "numbers", "-q")
    assert done.exit_code == 0, done.stderr
    page = Page((tmp_path / "double-report.html").read_text())
    assert "Not computed: requirement.1.quantity" in page.text
    assert "requirement.1.quantity" in refusal(file)


def refusal(file):
    """What `check` says of a design that it refuses."""
    done = run("check", file)
    assert done.exit_code == 2
    return done.stderr
