"""What README.md and docs/ say is so: commands run, links lead somewhere, keys and datasets are
those of the program."""

from __future__ import annotations

import csv
import re
import shlex
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import get_args

import click
import h5py
import pytest

from suspension_cli.analyses.compare import solve as compare
from suspension_cli.analyses.export import file as export
from suspension_cli.analyses.fit.osem_matrices import OsemFit
from suspension_cli.analyses.fit.response_fit import ResponseFit
from suspension_cli.analyses.modes import picture
from suspension_cli.cli.main import COMMANDS, main
from suspension_cli.conventions import ANALYSES
from suspension_cli.design import (
    bodies,
    control,
    goals,
    heat,
    imperfections,
    loop_filters,
    loop_sensors,
    materials,
    measured,
    required_quantities,
    schema,
    wires,
)
from suspension_cli.files.declared import items
from suspension_cli.models import registry
from suspension_cli.physics import ground
from tests.support.commandline import run
from tests.support.optima import EXAMPLE
from tests.support.paths import ROOT
from tests.support.quick_tradeoff import hurry
from tools import reference

DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
EXAMPLES = sorted((ROOT / "docs" / "examples").glob("*.md"))
LINKING = [
    *DOCUMENTS,
    ROOT / "CONTRIBUTING.md",
    ROOT / "CHANGELOG.md",
    *sorted((ROOT / "results").glob("*.md")),
]
TEXT = {document.name: document.read_text() for document in DOCUMENTS}

TABLES = {
    "[design]": [schema.Header],
    "[constants]": [schema.Constants],
    "[gas]": [schema.Gas],
    "[heat]": [heat.Heat],
    "[materials.NAME]": [schema.Material],
    "[materials.NAME.loss]": [materials.MaterialLoss],
    "[[stage]]": [schema.Stage],
    "body": [bodies.Body, bodies.BodyPart],
    "[stage.wires]": [schema.WireSet],
    "Wires of several sections": [wires.WireSection],
    "Necks of fibres": [wires.Neck],
    "Measured profiles of fibres": [wires.Profile],
    "Dampers on wires": [wires.WireDamper],
    "[stage.blades]": [schema.BladeSet],
    "[[stage.wire]]": [schema.Wire],
    "[[stage.blade]]": [schema.Blade],
    "[[stage.spring]]": [schema.Spring],
    "[stage.damping]": [schema.Damping],
    "[support]": [schema.Support],
    "[[control.loop]]": [control.Loop, loop_filters.DigitalFilter],
    "[[control.sensor]]": [loop_sensors.Sensor, loop_sensors.SensorInput],
    "[[control.osem]]": [control.Osem],
    "[[perturbation]]": [imperfections.Perturbation],
    "[[tolerance.wire]]": [
        imperfections.WireTolerance,
        imperfections.BodyTolerance,
        imperfections.BladeTolerance,
        imperfections.LegTolerance,
        imperfections.LinkTolerance,
    ],
    "[[tolerance.require]]": [imperfections.Requirement],
    "[[requirement]]": [required_quantities.RequiredQuantity],
}
"""Heading of docs/design-file.md to the types that it describes."""

OSEM = (
    "\"control.osem=[{name='A', stage='upper', at=[0.0, 0.0, 0.0], direction='x',"
    " reference='inertial'}]\""
)
MAKES = {
    "modes": "modes configs/husman2000/figure6.toml --max-frequency 700",
    "response": "response configs/double.toml --frequency 1,2",
    "thermal": "thermal configs/husman2000/figure6.toml --frequency 1,2",
    "budget": (
        "budget configs/triple-damped.toml --requirement goals/mirror-motion.csv"
        f" --frequency 1:5:2 --set {OSEM}"
    ),
    "xcouple": "xcouple configs/husman2000/figure6.toml --sweep k=1,1.1,mass=1 --workers 1",
    "tolerance": (
        "tolerance configs/husman2000/figure6.toml --fidelity string --workers 1 --set"
        " \"tolerance.body=[{stage='test', com={normal=1e-4}}]\" --builds 192"
        " --require 'test.x/support.x:10 < 1' --require 'test yaw > 0.1'"
    ),
    "sweep": (
        "sweep configs/double.toml --vary stage.test.wires.d=1e-3,2e-3 --result 1 --result "
        "'test yaw' --result test.x/support.x:1 --require 'test yaw > 0.1' --workers 1"
    ),
    "sensitivity": "sensitivity configs/double.toml",
    "fit": "fit configs/husman2000/table1-case4.toml measured/husman2000/table1-case4.toml",
    "optimise": (
        "optimise configs/husman2000/table1-case1.toml goals.toml --starts 1 --fidelity string"
    ),
    "tradeoff": "tradeoff configs/husman2000/figure6.toml --quantity thermal",
    "damp": (
        "damp configs/triple-damped.toml --frequency 1,2 --duration 1 --fidelity string"
        f" --set {OSEM}"
    ),
    "simulate": "simulate configs/triple-damped.toml --fidelity string --rate 256 --duration 1",
    "statespace": "export configs/double.toml --format hdf5 --loss",
    "zpk": "export configs/double.toml --format zpk --input support.x --output test.x --loss",
}
"""Group of a results file to a command that writes it."""
GOALS = """
goal = [{ kind = "band", modes = ["test longitudinal"], at_least = 0.9 }]
free = [{ name = "stage.test.wires.l", lower = 0.1, upper = 0.5 }]
"""


def blocks(text: str, language: str) -> list[list[str]]:
    """Lines of the fenced blocks of one language."""
    return [
        block.splitlines()
        for block in re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    ]


def commands(lines: list[str]) -> list[str]:
    """The lines of a block that call pendsus."""
    return [line for line in lines if re.match(r"(\.venv/bin/)?pendsus ", line)]


AMOUNTS = {
    "--builds": "20",
    "--starts": "1",
    "--max-frequency": "3",
    "--duration": "1",
    "--workers": "1",
}
"""Options that say how much of the same is done: less of it does."""


POINTS = 4
"""Of a grid LOW:HIGH:POINTS, at most."""


FEWER = {
    "damp": {"--frequency": f"0.1:100:{POINTS}", "--duration": "1", "--fidelity": "string"},
    "budget": {"--frequency": f"0.1:100:{POINTS}", "--fidelity": "string"},
    "response": {"--frequency": f"0.1:100:{POINTS}", "--fidelity": "string"},
    "thermal": {"--frequency": f"0.1:100:{POINTS}"},
    "report": {"--sections": "drawing,check", "--fidelity": "string"},
    "fit": {"--fidelity": "string"},
    "modes": {"--fidelity": "string"},
    "sensitivity": {"--fidelity": "string"},
    "sweep": {"--fidelity": "string"},
    "tolerance": {"--fidelity": "string"},
    "tradeoff": {"--quantity": "thermal"},
    "xcouple": {"--fidelity": "string"},
}
"""Options of a command that are given where a line does not: the command is tested elsewhere."""


def words_of(line: str) -> list[str]:
    """What follows `pendsus`, as a shell splits it, with less of the same."""
    words = [
        re.sub(r"(?<=[\d.]:)\d+(?=[:,]|$)", lambda found: str(min(int(found[0]), POINTS)), word)
        for word in shlex.split(line, comments=True)[1:]
    ]
    for option, fewer in AMOUNTS.items():
        if option in words:
            n = words.index(option) + 1
            words[n] = str(min(int(words[n]), int(fewer)))
    return words


def files_of(line: str) -> list[str]:
    """Files that a line reads."""
    return [
        word
        for word in shlex.split(line, comments=True)
        if word.endswith((".toml", ".h5")) and "=" not in word
    ]


TESTED = {
    EXAMPLE,
    *(
        tuple(
            f"measured/diagnosis/{word}" if word.endswith(".toml") else word
            for word in words_of(line.removeprefix("$ "))
        )
        for block in blocks(TEXT["diagnosis.md"], "console")
        for line in block
        if line.startswith("$ ")
    ),
}
"""Lines that other tests run."""


def calls() -> list[tuple[str, list[str], int]]:
    """Every line of every document, with its block and its place therein; what is said twice of
    shipped files is run once.

    The same with `--json` is the same, and what another test (`EXAMPLE`, the tutorials) runs word
    for word it runs alone.
    """
    found: dict[tuple[str, ...], tuple[str, list[str], int]] = {}
    for name, text in TEXT.items():
        for block in map(commands, blocks(text, "sh")):
            for n, line in enumerate(block):
                shipped = all((ROOT / file).exists() for file in files_of(line))
                words = tuple(word for word in words_of(line) if word != "--json")
                if words not in TESTED:
                    found.setdefault(
                        (*words, *([] if shipped else [name, *block[:n]])), (name, block, n)
                    )
    return list(found.values())


CALLS = calls()


def sections(name: str) -> dict[str, str]:
    """Headings of the second level, without backticks, and what stands under them."""
    parts = re.split(r"^## (.*)\n", TEXT[name], flags=re.MULTILINE)[1:]
    return {head.replace("`", ""): body for head, body in zip(parts[::2], parts[1::2], strict=True)}


def rows(body: str) -> list[list[str]]:
    """Cells of all table rows of a section that name something in backticks first."""
    return [
        [cell.strip() for cell in re.split(r"(?<!\\)\|", row)]
        for row in re.findall(r"^\|(.*)\|$", body, re.MULTILINE)
        if row.lstrip().startswith("`")
    ]


def named(cell: str) -> list[str]:
    """Everything in backticks."""
    return re.findall(r"`([^`]*)`", cell)


def laid_out(folder, monkeypatch):
    """Run in a folder that has the designs that we ship, and the data of tests."""
    for name in ("configs", "goals", "measured", "tests"):
        if not (folder / name).exists():
            (folder / name).symlink_to(ROOT / name)
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture
def folder(tmp_path, monkeypatch):
    return laid_out(tmp_path, monkeypatch)


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A folder for each block of a document, and the lines that were run in it.

    Lines read what earlier ones wrote.
    """
    return cache(lambda document, block: (tmp_path_factory.mktemp("block"), []))


def called(line: str) -> None:
    """Run one line of a block as a shell would, without its plot where it has one."""
    words = words_of(line)
    target = words[words.index(">") + 1] if ">" in words else None
    words = words[: words.index(">")] if target else words
    if not {"--measured", "--max-frequency", "--animate"} & {*words}:
        fewer = FEWER.get(words[0], {}).items()
        words += [word for pair in fewer if pair[0] not in words for word in pair]
    plots = any(
        param.name == "plot" for param in main.get_command(click.Context(main), words[0]).params
    )
    result = run(*words, *(["--no-plot"] if plots and "--plot" not in words else []))
    assert result.exit_code == 0, f"{line}\n{result.stderr}"
    assert "Traceback" not in result.stderr
    if target:
        Path(target).write_text(result.stdout)


@pytest.mark.parametrize(
    ("document", "block", "number"),
    CALLS,
    ids=[f"{name}: {block[n].partition('#')[0].strip()}" for name, block, n in CALLS],
)
def test_every_line_runs(document, block, number, folders, monkeypatch):
    """Lines that make a file which this one reads are run first."""
    folder, done = folders(document, tuple(block))
    laid_out(folder, monkeypatch)
    monkeypatch.setattr(picture, "FRAMES", 4)
    line = block[number]
    if " tradeoff " in line:
        hurry(monkeypatch)
    for n, earlier in enumerate(block[:number]):
        if n not in done and any(not Path(word).exists() for word in files_of(line)):
            called(earlier)
            done.append(n)
    called(line)
    done.append(number)


def test_first_steps_end_with_the_modes_of_the_design_itself(folder):
    """Runs with overrides or other options leave the file that the last line draws as it is."""
    *_, block = (block for block in blocks(TEXT["README.md"], "sh") if "plot" in block[-1])
    new, *rest = [line for line in block if re.search(r"pendsus (new|modes|plot) ", line)]
    assert files_of(rest[-1]) == ["results/my-modes.h5"] and len(rest) > 3
    called(new)
    called(rest[0])
    first = Path("results/my-modes.h5").read_bytes()
    for line in rest[1:]:
        called(line)
    assert Path("results/my-modes.h5").read_bytes() == first


@pytest.mark.parametrize("page", EXAMPLES, ids=lambda path: path.stem)
def test_examples_are_short_and_listed(page):
    assert len(page.read_text().splitlines()) <= 60
    assert f"(examples/{page.name})" in TEXT["index.md"]


def test_every_command_is_in_the_reference():
    found = sections("commands.md")
    assert [head.removeprefix("pendsus ") for head in found] == list(COMMANDS)
    for head, body in found.items():
        assert any(
            line.startswith(head) for block in blocks(body, "sh") for line in commands(block)
        ), f"{head} has no example"


@pytest.mark.parametrize("name", COMMANDS)
def test_options_in_the_reference_exist(name):
    known = {
        option
        for param in main.get_command(click.Context(main), name).params
        for option in (*param.opts, *param.secondary_opts)
    }
    body = sections("commands.md")[f"pendsus {name}"]
    assert set(re.findall(r"`(--[a-z-]+)", body)) <= known | {"--fidelity"}


@pytest.mark.parametrize("document", LINKING, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_somewhere(document):
    for link in re.findall(r"\]\(([^)\s]+)\)", document.read_text()):
        path, _, anchor = link.partition("#")
        if "://" in link:
            continue
        target = document.parent / path if path else document
        assert target.exists(), link
        if anchor:
            heads = re.findall(r"^#+ (.*)$", target.read_text(), re.MULTILINE)
            assert anchor in [
                re.sub(r"[^\w -]", "", head).lower().replace(" ", "-") for head in heads
            ], link


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_files_named_exist(document):
    """And tests, named as `tests/FILE.py::FUNCTION`."""
    for name in re.findall(
        r"`((?:docs|tools|tests|configs|suspension_cli)/[^`\s*]+)`", document.read_text()
    ):
        path, _, function = name.partition("::")
        assert (ROOT / path).exists(), name
        if function:
            text = (ROOT / path).read_text()
            assert re.search(rf"^def {re.escape(function)}\(", text, re.MULTILINE), name


def test_every_promise_names_its_test():
    promises = sections("accuracy.md")["Promises"]
    lines = re.findall(r"^\|(.*)\|$", promises, re.MULTILINE)
    kept = [row for row in lines if not row.startswith((" promise ", "---"))]
    with (ROOT / "docs" / "promises.csv").open(newline="") as stream:
        others = [row["kept_by"] for row in csv.DictReader(stream)]
    assert len(kept) + len(others) > 30
    for row in kept:
        assert re.search(r"`tests/[\w/]+\.py::test_\w+`", row), row
    for name in " ".join(others).split():
        path, _, function = name.partition("::")
        assert re.search(rf"^def {function}\(", (ROOT / path).read_text(), re.MULTILINE), name


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_designs_in_toml_are_tables_of_the_format(document):
    """Every example in TOML parses, and its tables are known."""
    import tomllib

    known = {
        "fit.md": measured.Measured,
        "measurements.md": measured.Measured,
        "optimise.md": goals.Goals,
    }.get(document.name, schema.Design)
    for block in blocks(document.read_text(), "toml"):
        assert set(tomllib.loads("\n".join(block))) <= set(known.__struct_fields__)


@pytest.mark.parametrize("heading", TABLES)
def test_keys_of_the_design_file(heading):
    (body,) = [
        body for head, body in sections("design-file.md").items() if head.split(", ")[0] == heading
    ]
    keys = {key for kind in TABLES[heading] for key in kind.__struct_fields__}
    listed = {key for row in rows(body) for key in named(row[0])}
    for kind in TABLES[heading]:
        base, other = reference.LIKE.get(kind.__name__, (None, None))
        if base is not None:
            first, *rest, last = base.__struct_fields__
            assert f"| `{first}` to `{last}` | as in {other} |" in body
            listed |= {*rest}
    assert listed == keys


def test_every_table_of_the_design_file_is_described():
    heads = [head.split(", ")[0] for head in sections("design-file.md")]
    assert set(TABLES) <= set(heads)
    described = {re.sub(r"[][]", "", head).split(".")[0] for head in heads}
    assert set(schema.Design.__struct_fields__) <= described


@pytest.mark.parametrize(
    ("page", "heading", "names"),
    [
        ("README.md", "model", registry.FILES),
        ("budget.md", "source", (*ground.SHIPPED, "none")),
        ("handing-over.md", "`--format`", export.FORMATS),
        ("optimise.md", "kind", get_args(goals.Kind)),
    ],
)
def test_tables_list_what_the_program_knows(page, heading, names):
    (body,) = re.findall(rf"^\| {heading} \|.*\n((?:\|.*\n)+)", TEXT[page], re.MULTILINE)
    assert sorted(re.findall(r"^\| `([^`]+)`", body, re.MULTILINE)) == sorted(names)


def _at_room_temperature(value: materials.Property | None) -> float | None:
    """A property at 290 K; None where it is not known there."""
    if isinstance(value, materials.AgainstTemperature) and value.unknown_range(290.0):
        return None
    return None if value is None else materials.value_at(value, 290.0)


def test_built_in_losses_are_those_of_the_table():
    (body,) = [body for head, body in sections("wires.md").items() if head == "Built-in values"]
    cells = [
        [cell.strip() for cell in row.split("|")]
        for row in re.findall(r"^\| ([a-z].*)\|$", body, re.MULTILINE)
    ][1:]
    assert {row[0] for row in cells} == set(materials.BUILT_IN)
    for name, *values in cells:
        made = materials.BUILT_IN[name]
        loss = made.loss or materials.MaterialLoss()
        known = (
            loss.angle,
            loss.surface_depth,
            made.thermal_expansion,
            made.modulus_slope,
            made.specific_heat,
            made.thermal_conductivity,
        )
        known = [_at_room_temperature(value) for value in known]
        values = [value.removesuffix("†").removesuffix("*").strip() for value in values]
        assert [float(value) if value else None for value in values[:6]] == known, name


def declared_datasets(kind: type, folder: str = "", dims: str = "") -> Iterator[tuple]:
    """Names of the datasets of a record, each with its axes and its unit."""
    for item in items(kind):
        name = f"{folder}{item.key}"
        axes = ", ".join(item.dims) or dims
        if item.form in ("record", "columns"):
            yield from declared_datasets(item.leaf, f"{name}/", axes)
        elif item.form == "records":
            yield from declared_datasets(item.leaf, f"{name}/N/")
        else:
            unit = item.unit or ("name" if item.leaf is str else "1")
            yield name, ("" if item.is_scale or axes == item.key else axes, unit)


@pytest.mark.parametrize(
    ("section", "kind"),
    [
        ("Group compare", compare.Comparison),
        ("Transfer functions of a fit", ResponseFit),
        ("Matrices of a fit", OsemFit),
    ],
)
def test_datasets_that_no_command_of_this_file_writes(section, kind):
    declared = dict(declared_datasets(kind))
    numbered = {"number": ("", "1")}  # scales without a field
    for row in rows(sections("format.md")[section]):
        names = named(row[0])
        units = row[1].split(", ")
        units = units if len(units) == len(names) else [row[1]] * len(names)
        axes = row[0].partition("[")[2].removesuffix("]")
        for name, unit in zip(names, units, strict=True):
            assert (numbered | declared)[name] == (axes, unit), name


def datasets(group: h5py.Group) -> list[h5py.Dataset]:
    """All datasets of a group and of the groups in it."""
    return [
        found
        for item in group.values()
        for found in (datasets(item) if isinstance(item, h5py.Group) else [item])
    ]


def test_groups_of_all_analyses_are_compared():
    """Except of compare, whose groups depend on the items; export writes two, four others none."""
    assert set(ANALYSES) - {"compare", "export", "check", "draw", "report"} <= set(MAKES)


@pytest.mark.parametrize("group", MAKES)
def test_datasets_of_a_results_file(group, folder, monkeypatch):
    """Names, units and axes of a group are those of docs/format.md, and none is left out but axes
    and texts of units that other rows name."""
    hurry(monkeypatch)
    (folder / "goals.toml").write_text(GOALS)
    called(f"pendsus {MAKES[group]} --out out")
    (path,) = (folder / "out").glob("*.h5")
    described = {
        name: (row[0].partition("[")[2].removesuffix("]"), row[1])
        for row in rows(sections("format.md")[f"Group {group}"])
        for name in named(row[0])
    }
    axes_and_units = re.findall(r"\w+", " ".join(", ".join(row) for row in described.values()))
    found = set()
    with h5py.File(path) as file:
        assert set(file[group].attrs) <= set(named(TEXT["format.md"]))
        swept = set(file[group].attrs.get("axes", ()))
        for dataset in datasets(file[group]):
            name = re.sub(r"\b\d+\b", "N", dataset.name.removeprefix(f"/{group}/"))
            name = "NAME" if name in swept else re.sub("^.* from .*/", "OUTPUT from INPUT/", name)
            if name not in described:
                assert name.rpartition("/")[2] in axes_and_units, name
                assert dataset.is_scale or dataset.attrs["units"] == "name", name
                continue
            found.add(name)
            axes, units = described[name]
            pattern = re.sub(r"\\{\w+\\}", ".+", re.escape(units))
            assert re.fullmatch(pattern, dataset.attrs["units"]) or units == "its own", name
            labels = [axis.label for axis in dataset.dims]
            if swept & {*labels}:
                labels = ["NAME, ...", *(label for label in labels if label not in swept)]
            assert ", ".join(labels) == axes, name
            assert dataset.is_scale or all(len(axis) for axis in dataset.dims), name
    assert found == set(described)
