"""Files that describe the project to others (archives, package indexes, GitHub) agree with
pyproject.toml and the program, and are valid."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib

import pytest
import yaml

from suspension_cli.version import __version__
from tests.support.paths import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text())
CODEMETA, ZENODO = (
    json.loads((ROOT / name).read_text()) for name in ("codemeta.json", ".zenodo.json")
)
RECIPE = yaml.safe_load((ROOT / "conda" / "recipe.yaml").read_text())
WORKFLOWS = {path.name: path for path in (ROOT / ".github" / "workflows").iterdir()}
PYTHONS = [
    found[1]
    for line in PROJECT["classifiers"]
    if (found := re.fullmatch(r"Programming Language :: Python :: (3\.\d+)", line))
]


def test_versions():
    versions = {CITATION["version"], CODEMETA["version"], RECIPE["context"]["version"]}
    assert versions == {__version__}
    assert "version" not in ZENODO  # which takes that of the tag


def test_licences():
    licence = PROJECT["license"]
    assert {CITATION["license"], ZENODO["license"], RECIPE["about"]["license"]} == {licence}
    assert CODEMETA["license"] == f"https://spdx.org/licenses/{licence}"
    text = (ROOT / "LICENSE").read_text()
    assert text.startswith(f"{licence} License\n\nCopyright (c) ")


def test_names_authors_and_words():
    assert CODEMETA["name"] == RECIPE["package"]["name"] == PROJECT["name"]
    assert ZENODO["title"] == CITATION["title"]
    authors = [one["name"] for one in PROJECT["authors"]]
    for listed in (CITATION["authors"], CODEMETA["author"], ZENODO["creators"]):
        assert [one["name"] for one in listed] == authors
    words = PROJECT["description"]
    assert words == CITATION["abstract"] == CODEMETA["description"] == ZENODO["description"]
    assert words == RECIPE["about"]["summary"]
    for one in (CITATION, CODEMETA, ZENODO):
        assert one["keywords"] == PROJECT["keywords"]


def test_requirements():
    assert CODEMETA["softwareRequirements"] == PROJECT["dependencies"]
    python, *others = RECIPE["requirements"]["run"]
    assert python == f"python {PROJECT['requires-python']}"
    assert [line.replace("matplotlib-base ", "matplotlib ") for line in others] == [
        line.replace(">=", " >=") for line in PROJECT["dependencies"]
    ]
    (script,) = PROJECT["scripts"].items()
    assert RECIPE["build"]["python"]["entry_points"] == [" = ".join(script)]


def test_versions_of_python():
    """Those of the classifiers are tested: by workflows, and by make where they are installed."""
    assert PROJECT["requires-python"] == f">={PYTHONS[0]}"
    jobs = yaml.safe_load(WORKFLOWS["tests.yml"].read_text())["jobs"]
    assert jobs["tests"]["strategy"]["matrix"]["python"] == PYTHONS
    assert jobs["installed"]["strategy"]["matrix"]["python"] == PYTHONS
    makefile = (ROOT / "Makefile").read_text()
    assert f"for version in {' '.join(PYTHONS[1:])};" in makefile


@pytest.mark.parametrize("name", WORKFLOWS)
def test_workflows_do_nothing_of_their_own(name):
    """They call make targets, or what these call where there is no make; paths that they name
    exist."""
    makefile = (ROOT / "Makefile").read_text()
    jobs = yaml.safe_load(WORKFLOWS[name].read_text())["jobs"]
    steps = [(job, step["run"]) for job in jobs for step in jobs[job]["steps"] if "run" in step]
    for job, line in steps:
        if line.startswith("make "):
            assert re.search(rf"^{line.split()[1]}:", makefile, re.MULTILINE), line
        elif job != "physics-on-windows":
            assert line == "python -m tools.dist dist"
        for path in re.findall(r"\btests/\w+", line):
            assert (ROOT / path).is_dir(), path


@pytest.mark.parametrize(
    ("schema", "files"),
    [
        ("github-workflows", ".github/workflows/*.yml"),
        ("github-issue-forms", ".github/ISSUE_TEMPLATE/[!c]*.yml"),
        ("github-issue-config", ".github/ISSUE_TEMPLATE/config.yml"),
        ("readthedocs", ".readthedocs.yaml"),
        ("citation-file-format", "CITATION.cff"),
    ],
)
def test_files_follow_their_schemas(schema, files):
    """Without a network: check-jsonschema brings these schemas."""
    words = ["--builtin-schema", f"vendor.{schema}", *map(str, ROOT.glob(files))]
    done = subprocess.run(
        [sys.executable, "-m", "check_jsonschema", *words],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout


def test_issues_ask_for_design_and_version():
    for path in (ROOT / ".github" / "ISSUE_TEMPLATE").glob("[!c]*.yml"):
        asked = {part["id"] for part in yaml.safe_load(path.read_text())["body"]}
        assert {"design", "version"} <= asked
        assert "pendsus --version" in path.read_text()


def test_the_paper_cites_its_references_and_shows_results():
    text, references = ((ROOT / "paper" / f"paper.{end}").read_text() for end in ("md", "bib"))
    header, body = text.split("---\n", 2)[1:]
    keys = re.findall(r"^@\w+\{(\w+),", references, re.MULTILINE)
    assert sorted(set(re.findall(r"@([a-z]+\d*)\b", body))) == sorted(keys)
    assert yaml.safe_load(header)["title"] == CITATION["title"]
    pictures = re.findall(r"\]\((\S+\.png)\)", body)
    assert pictures and all((ROOT / "paper" / path).is_file() for path in pictures)
