"""Pages are what happens: each command prints what the page shows, and draws the picture that
follows."""

from __future__ import annotations

import re
import shutil
import struct
from pathlib import Path

import pytest

from suspension_cli.drawing import style
from tests.conftest import SHIPPED_DPI
from tools import tutorial

NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?:e[-+]\d+)?(?![\w.]*\w)")
ROUNDING = 1e-12
"""Numbers below are rounding errors, whose size is no promise."""


def last_place(text: str) -> float:
    """The value of one unit in the last place of a number as it is written."""
    digits, _, power = text.partition("e")
    return 10.0 ** (int(power or 0) - len(digits.partition(".")[2]))


def alike(shown: str, found: str) -> bool:
    """The same words and, to one unit in the last place, the same numbers."""
    if NUMBER.sub("#", shown).split() != NUMBER.sub("#", found).split():
        return False
    pairs = zip(NUMBER.findall(shown), NUMBER.findall(found), strict=True)
    return all(
        abs(float(a) - float(b)) <= 1.01 * last_place(a) or max(float(a), float(b)) < ROUNDING
        for a, b in pairs
    )


def matches(shown: list[str], found: list[str]) -> bool:
    """Line by line alike; a line of three dots stands for any number of lines."""
    if not shown:
        return not found
    if shown[0] == "...":
        return any(matches(shown[1:], found[n:]) for n in range(len(found) + 1))
    return bool(found) and alike(shown[0], found[0]) and matches(shown[1:], found[1:])


def size(picture: Path) -> tuple[int, int]:
    """Width and height of a PNG in pixels."""
    return struct.unpack(">II", picture.read_bytes()[16:24])


COMMANDS = {
    "README": {"modes"},
    "cavity": {"sweep"},
    "control": {"damp"},
    "damping": {"new", "damp", "budget"},
    "diagnosis": {"response", "fit", "compare"},
    "finesse": set(),
    "loops": {"damp", "budget", "simulate"},
    "quadruple": {"new", "thermal", "modes"},
    "thermal": {"check"},
    "tolerance": {"tolerance"},
    "tower": {"check", "modes", "response", "budget"},
    "trades": {"new", "sweep"},
    "triple": {"new", "modes", "sweep", "thermal"},
}
PICTURES = {"triple": 1, "diagnosis": 1, "quadruple": 1, "cavity": 1, "trades": 1}


@pytest.fixture(scope="module", params=COMMANDS)
def page(request):
    return request.param


@pytest.fixture(scope="module")
def steps(page, tmp_path_factory):
    """What the page did, with its pictures out of the folder that is gone afterwards."""
    kept = []
    with tutorial.folder(page):
        for number, step in enumerate(tutorial.steps(text_of(page))):
            copy = (
                shutil.copy(step.found, tmp_path_factory.mktemp("drawn") / f"{number}.png")
                if step.kind == "picture"
                else step.found
            )
            kept.append((step, copy))
    return kept


def text_of(page):
    return tutorial.PAGES[page].read_text(encoding="utf-8")


def test_output_is_shown_with_its_command():
    """So that it is compared here: the line that names the model is in no other block."""
    assert set(tutorial.PAGES) == set(COMMANDS)
    for file in (tutorial.ROOT / "README.md", *tutorial.DOCS.rglob("*.md")):
        text = file.read_text(encoding="utf-8")
        compared = "".join(step[1] or "" for step in tutorial.PART.finditer(text))
        assert len(re.findall("^ *model: ", text, re.MULTILINE)) == len(
            re.findall("^ *model: ", compared, re.MULTILINE)
        ), file


def test_every_command_prints_what_is_shown(page, steps):
    commands = [step for step, _ in steps if step.kind == "console"]
    assert {step.text.split()[2] for step in commands} >= COMMANDS[page]
    for step in (step for step, _ in steps if step.kind in ("console", "python")):
        assert matches(step.text.splitlines(), step.found.splitlines()), (
            f"run: make tutorial\n{step.text}\nfound:\n{step.found}"
        )


def test_every_picture_is_drawn(page, steps):
    pictures = [(step, Path(copy)) for step, copy in steps if step.kind == "picture"]
    assert len(pictures) == PICTURES.get(page, 0)
    for step, drawn in pictures:
        inches = [pixels / style.DPI for pixels in size(drawn)]
        shown = [pixels / SHIPPED_DPI for pixels in size(tutorial.PAGES[page].parent / step.text)]
        assert shown == pytest.approx(inches, rel=0.02), f"run: make tutorial ({step.text})"


def test_pictures_are_all_used():
    used = {
        step.rpartition("/")[2]
        for page in tutorial.PAGES
        for step in re.findall(r"\]\((?:\.\./|docs/)?(images/[^)]*)\)", text_of(page))
    }
    assert {path.name for path in (tutorial.DOCS / "images").iterdir()} == used


def test_what_is_alike():
    assert alike("Q 3.174e+06", "Q 3.175e+06") and not alike("Q 3.174e+06", "Q 3.174e+07")
    assert not alike("f 0.59105 Hz", "g 0.59105 Hz")
    assert alike("balanced to 9e-17", "balanced to 2e-16")


def test_output_shown_in_part_is_made_anew():
    new = "$ pendsus modes my.toml\nwrote a\nmodel: beam\n\n  1  0.592  roll\n  2  0.6  yaw\n"
    old = "$ pendsus modes my.toml\n...\nmodel: string\n\n  1  0.591  roll\n...\n"
    assert tutorial.renew(old, new) == (
        "$ pendsus modes my.toml\n...\nmodel: beam\n\n  1  0.592  roll\n...\n"
    )
    assert tutorial.renew(old.replace("...\n", ""), new) == new


def test_dots_match_any_lines():
    assert matches(["a", "...", "d"], ["a", "b", "c", "d"])
    assert matches(["a", "..."], ["a"])
    assert not matches(["a", "...", "e"], ["a", "b", "c", "d"])
