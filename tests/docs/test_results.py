"""results/README.md shows every result, with the numbers of the results themselves."""

from __future__ import annotations

import re

import numpy as np
import pytest

from tests.support.golden import ROOT
from tools import figure5, thermal

README = (ROOT / "results" / "README.md").read_text()
MAKEFILE = (ROOT / "Makefile").read_text()
SECTIONS = dict(
    zip(*[iter(re.split(r"^## (.*)\n", README, flags=re.MULTILINE)[1:])] * 2, strict=True)
)
KEPT = [
    path.name
    for path in (ROOT / "results").iterdir()
    if path.suffix in (".md", ".csv") or (path.suffix == ".png" and "-" not in path.name)
]
"""What git keeps of results/: .gitignore."""
COMPUTED = {"Figure 5: the longitudinal transfer function", "Thermal noise"}
"""Sections whose numbers are in no file: their tools print them."""


PAGES = "".join(path.read_text() for path in (ROOT / "results").glob("*.md"))


@pytest.mark.parametrize("name", sorted(set(KEPT) - {"README.md"}))
def test_every_result_is_shown(name):
    """Pages are linked from README.md, pictures shown there or on one of its pages."""
    mark, where = ("!", PAGES) if name.endswith(".png") else ("", README)
    assert re.search(rf"{mark}\[[^]]*\]\({re.escape(name)}\)", where)


def test_every_target_has_a_section():
    (targets,) = re.findall(r"^RESULTS := (.*)$", MAKEFILE, re.MULTILINE)
    reported = re.findall(r"`make (\w+)`", "".join(SECTIONS.values()))
    assert set(reported) == set(targets.split())


@pytest.mark.parametrize("title", sorted(set(SECTIONS) - COMPUTED))
def test_numbers_are_those_of_the_results(title):
    """Every number of three digits and more stands in a file that the section links to, or in the
    page on the paper."""
    body = SECTIONS[title]
    linked = [ROOT / "results" / name for name in re.findall(r"\]\((\w[\w-]*\.md)\)", body)]
    known = "".join(
        path.read_text() for path in [*linked, ROOT / "docs" / "paper.md", ROOT / "docs" / "fit.md"]
    )
    for number in re.findall(r"(?<![\w.])\d+\.\d{2,}(?:e-?\d+)?", body):
        assert number in known, number


def test_figure_5_falls_as_described():
    answer, _, _ = figure5.solved()
    assert (
        f"{figure5.slope(answer):.3f}".replace("-", "−")
        in SECTIONS["Figure 5: the longitudinal transfer function"]
    )


def test_thermal_noise_is_as_described():
    (noise,) = thermal.solved().motions
    for value in np.interp((10, 100), thermal.FREQUENCY, noise.amplitude):
        assert f"{value:.2e}" in SECTIONS["Thermal noise"]
