"""Moving pictures of modes."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

import suspension_cli as sus
from suspension_cli.analyses.modes import picture
from suspension_cli.conventions import DOFS
from suspension_cli.drawing import style
from suspension_cli.equilibrium.nominal import expand
from tests.support.commandline import run
from tests.support.paths import CONFIGS

SINGLE = CONFIGS / "husman2000" / "table1-case3.toml"


@pytest.fixture(scope="module", autouse=True)
def few():
    """Half of the frames move as smoothly."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(picture, "FRAMES", 12)
        yield


@pytest.fixture(scope="module")
def moving():
    design = sus.read(SINGLE)
    found = sus.modes(design, fidelity="string")
    return picture.animate(found, 0, design.design, expand(design.design))


def frames(data):
    image = Image.open(io.BytesIO(data))
    shown = []
    for n in range(image.n_frames):
        image.seek(n)
        shown.append(np.asarray(image.convert("RGB")))
    return image, shown


def test_gif_is_small_and_repeats_smoothly(moving):
    image, shown = frames(moving)
    assert image.info["loop"] == 0
    assert image.info["duration"] == picture.DURATION
    assert len(shown) == picture.FRAMES
    middle = picture.FRAMES // 2
    assert (shown[0] != shown[middle]).any()
    for n in range(1, middle):  # the way back is the way there
        assert (shown[n] == shown[-n]).all()
    steps = [(shown[n] != shown[n - 1]).any(-1).mean() for n in range(len(shown))]
    assert max(steps) < 0.2
    colours = np.unique(np.stack(shown[::4]).astype(int) @ (1 << 16, 1 << 8, 1))
    assert len(colours) <= picture.COLOURS
    assert (shown[0][0, 0] == 255).all()
    assert len(moving) < 300_000


def test_command_writes_each_mode(tmp_path, moving):
    words = ("--fidelity", "string", "--no-plot", "-q", "--out", tmp_path)
    assert run("modes", SINGLE, *words, "--animate", "test transverse").exit_code == 0
    stem = "husman2000-table1-case3-modes"
    written = sorted(one.name for one in tmp_path.iterdir())
    assert written == [f"{stem}-1.gif", f"{stem}.h5"]
    assert (tmp_path / f"{stem}-1.gif").read_bytes() == moving  # the same bytes again


def test_modes_of_wires_are_refused():
    found = sus.modes(sus.read(SINGLE), max_frequency=600.0)
    number = int(np.flatnonzero(found.order > 0)[0]) + 1
    with pytest.raises(sus.InputError, match="mode of wires alone"):
        sus.animate(found, number, "never.gif")


def test_many_modes_are_split_by_kind():
    design = sus.example("eight-stages").design
    found = sus.modes(sus.example("eight-stages"), fidelity="string")
    pages = picture.draw_pages(found, design, expand(design), "")
    numbers = sorted(n for page in pages for n in page.numbers)
    assert numbers == list(range(48))
    for page in pages:
        width, height = page.figure.get_size_inches()
        assert width == style.PAGE_WIDTH
        assert height <= style.PAGE_HEIGHT
        kinds = {DOFS.index(found.home[n][1]) for n in page.numbers}
        assert kinds in ({0, 4}, {1, 3}, {2, 5}, {0}, {4}, {1}, {3}, {2}, {5})
