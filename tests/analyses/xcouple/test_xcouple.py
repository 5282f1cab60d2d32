"""Cross-coupling of a symmetric design is exactly 0; with one imperfect wire it is right to first
order and in every digit."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.analyses.xcouple.imperfect_builds import ImperfectBuilds
from suspension_cli.design.reader import read
from suspension_cli.grids import parse_grid
from suspension_cli.linear import signals
from suspension_cli.studies import builds
from suspension_cli.studies.job import Axis
from tests.support.commandline import run, strict_json
from tests.support.couplings import (
    DOFS,
    FIGURE_6,
    FILE,
    FORBIDDEN,
    TRIPLE_FILE,
    answers,
    balanced,
    exact,
    question,
    ratios,
)
from tests.support.golden import CONFIGS

SYMMETRIC = [FILE, TRIPLE_FILE, *(CONFIGS / "husman2000").glob("table1-case*.toml")]
OWN = [0, 1, 2, 5]
"""x, y, z and yaw of the support move every design's last stage likewise; its roll and pitch need
not."""
HOLDS = ["loaded-length", "natural-length"]
COUPLING = [
    *((hold, name) for hold in HOLDS for name in ("k", "lower_offset", "length", "com")),
    ("natural-length", "offset_z"),
    ("natural-length", "lower_offset_z"),
    # with a higher power, or not at all
    *((hold, name) for hold in HOLDS for name in ("offset", "offset_y")),
    ("loaded-length", "offset_z"),
    ("loaded-length", "com_z"),
]
"""What couples x to z: (what is held, parameter)."""


@pytest.mark.parametrize("file", SYMMETRIC, ids=lambda file: file.stem)
def test_the_table_of_couplings_has_26_exact_zeros(file, tmp_path):
    stage = read(file).design.stage[-1].name
    options = f"--matrix --json --observe {stage} --frequency 0.3,7,50,3000".split()
    result = run("xcouple", file, *options, "--out", tmp_path)
    assert result.exit_code == 0, result.stderr
    answer = strict_json(result.stdout)
    matrix = np.array(answer["matrix_real"]) + 1j * np.array(answer["matrix_imag"])
    assert matrix.shape == (4, 6, 6)
    assert FORBIDDEN.sum() == 26
    assert (matrix[:, FORBIDDEN] == 0).all()
    assert (matrix[:, OWN, OWN] != 0).all()
    if file == FILE:
        assert (matrix[:, ~FORBIDDEN] != 0).all()


@pytest.mark.parametrize(
    ("file", "hold", "level"),
    [
        *((file, HOLDS[n % 2], "string") for n, file in enumerate(SYMMETRIC)),
        (FILE, HOLDS[1], "beam"),
        (TRIPLE_FILE, HOLDS[0], "violin"),
    ],
    ids=lambda value: getattr(value, "stem", value),
)
def test_the_batch_gives_exact_zeros_for_perfect_wires(file, hold, level):
    """Beside builds that are not perfect; forces too."""
    design = read(file).design
    last = design.stage[-1].name
    requested, known = (
        question(design, f"{last}.1", hold),
        ("support", *(stage.name for stage in design.stage)),
    )
    found = balanced(
        {"k": np.array([1.0, 1.1, 1.0]), "offset": np.array([0.0, 0.0, 1e-4])},
        requested,
        design,
        level,
    )
    assert not found.status.any()
    outputs = [signals.parse_output(f"{last}.{dof}", known) for dof in DOFS]
    for names in (
        [f"support.{dof}" for dof in DOFS],
        [f"{last}.{name}" for name in signals.FORCES],
    ):
        value = builds.transfer(
            found,
            np.array([0.3, 50.0, 3000.0]),
            [signals.parse_input(name, known) for name in names],
            outputs,
        )
        assert (value[0][:, FORBIDDEN] == 0).all()
        assert (value[0][:, OWN, OWN] != 0).all()
        assert (value[1:][..., FORBIDDEN] != 0).any((1, 2)).all()
    none = answers({"k": [1.0], "offset": [0.0]}, requested, design, level)
    assert (none["ratio"] == 0).all()


def steps(name):
    """Tiny imperfections: of k from 1e-9 to 1e-5, of lengths as much of 1 mm."""
    return np.geomspace(1e-9, 1e-5, 17) * (1.0 if name == "k" else 1e-3)


@pytest.mark.parametrize(("hold", "name"), COUPLING)
def test_every_digit_of_a_tiny_coupling(hold, name):
    """Against 60 digits: to 1e-11 of itself or 2e-18 of the vertical motion, whichever is more."""
    step = steps(name)[::8]
    values = 1 + step if name == "k" else step
    found = ratios({name: values}, question(hold=hold))
    expected = np.array([exact({name: value}, hold=hold) for value in values])
    assert (np.abs(found - expected) <= 1e-11 * np.abs(expected) + 2e-18).all()


def figure_6(hold):
    """The sweep that the design requests, and its ratios (k, offset)."""
    table = FIGURE_6.analysis["xcouple"]
    axes = tuple(Axis(name, tuple(parse_grid(table[name], name))) for name in ("k", "offset"))
    job = ImperfectBuilds(read(FILE).text, axes, question(hold=hold))
    return job, job.compute(0, job.count)["ratio"].real.reshape(job.shape)


@pytest.mark.parametrize(
    ("hold", "largest"), [("loaded-length", 5.9e-4), ("natural-length", 3.5e-4)]
)
def test_figure_6(hold, largest):
    """Husman et al. (2000), Figure 6: no imperfection of k, no coupling to speak of; the most at
    the softest wire, offset outwards."""
    job, ratio = figure_6(hold)
    size = np.abs(ratio)
    assert ratio.shape == (41, 5)
    assert size.max() == pytest.approx(largest, rel=0.02)
    assert np.unravel_index(size.argmax(), size.shape) == (0, 4)
    k, offset = np.array(job.axes[0].values), np.array(job.axes[1].values)
    assert size[20, 2] == 0
    assert (np.diff(size[:20, 2]) < 0).all()
    assert (np.diff(size[20:, 2]) > 0).all()
    assert (np.sign(ratio[:, 2]) == np.sign(k - 1)).all()
    for i in (0, 13, 27, 40):
        for j in (0, 3, 4):
            assert ratio[i, j] == pytest.approx(
                exact({"k": k[i], "offset": offset[j]}, hold=hold), rel=1e-10
            )
