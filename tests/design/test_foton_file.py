"""Filter files of front ends as filters of loops: their coefficients, results that embed them, and
damaged files."""

from __future__ import annotations

import numpy as np
import pytest
import tomli_w
from scipy import signal

import suspension_cli as sus
from suspension_cli.errors import InputError
from tests.analyses.damp.test_damp_cli import damped
from tests.support.commandline import run
from tests.support.foton import bank

RATE = 2048.0
FIRST = signal.butter(5, 40.0, fs=RATE, output="sos")
SECOND = signal.ellip(4, 1, 30, [20.0, 60.0], "bandstop", fs=RATE, output="sos")
FILE = {"file": "X1SUS.txt", "module": "M0_DAMP_L", "sections": [1, 2]}


def design(tmp_path, text=None, **changes):
    """Path of a design with a digital filter in its loop, beside the file of filters."""
    raw = damped(("x",), filter=FILE | changes)
    del raw["control"]["loop"][0]["damper"]
    text = bank("M0_DAMP_L", RATE, FIRST, SECOND) if text is None else text
    (tmp_path / "X1SUS.txt").write_text(text)
    path = tmp_path / "my.toml"
    path.write_text(tomli_w.dumps(raw))
    return path


def test_sections_have_the_response_of_their_coefficients(tmp_path):
    (loop,) = sus.read(design(tmp_path, gain=-2.5)).design.control.loop
    f = np.geomspace(0.01, 1000, 50)
    exact = -2.5 * signal.sosfreqz(np.concatenate([FIRST, SECOND]), f, fs=RATE)[1]
    off = np.abs(loop.controller.at(f) - exact)
    assert (off <= 1e-9 * np.abs(exact) + 1e-13).all()


def test_results_contain_the_filter(tmp_path):
    path = design(tmp_path)
    few = ("--frequency", "1,2", "--duration", "1", "--no-plot", "--fidelity", "force")
    result = run("damp", path, "--out", tmp_path / "out", *few)
    assert result.exit_code == 0, result.stderr
    (tmp_path / "X1SUS.txt").unlink()
    (file,) = (tmp_path / "out").glob("*.h5")
    again = sus.parse(sus.load(file).design.text)
    (loop,) = again.design.control.loop
    assert loop.filter.source == "X1SUS.txt, M0_DAMP_L, sections 1, 2"
    assert loop.filter.rate == RATE
    exact = signal.sosfreqz(np.concatenate([FIRST, SECOND]), [3.0], fs=RATE)[1]
    assert loop.controller.at(3.0) == pytest.approx(exact[0], rel=1e-9)


def test_a_sensor_of_another_rate(tmp_path):
    """A digital controller and an analog sensor multiply."""
    path = design(tmp_path, sections=[1])
    source = sus.read(path).replace({"control.loop.loop-x.sensor_response": 'pole(30,"n")'})
    (loop,) = source.design.control.loop
    exact = signal.sosfreqz(FIRST, [3.0], fs=RATE)[1][0] / (1 + 0.1j)
    assert loop.controller_and_sensor.at(3.0) == pytest.approx(exact, rel=1e-9)


GOOD = bank("M0_DAMP_L", RATE, FIRST)


@pytest.mark.parametrize(
    ("text", "changes", "says"),
    [
        (None, {"module": "M0_DAMP_P"}, "has no module \"M0_DAMP_P\"; did you mean 'M0_DAMP_L'?"),
        (None, {"sections": [1, 7]}, "has no section 7 (FM7) of M0_DAMP_L; sections there: 1, 2"),
        (None, {"sections": [0]}, "filter.sections.1 = 0: must be at least 1"),
        (None, {"sections": []}, "has no effect without sections"),
        (None, {"file": "nix.txt"}, 'filter.file = "nix.txt": cannot be read'),
        (None, {"modul": "x"}, "modul"),
        (None, {"rate": 3.0}, "design and rate go together"),
        ("nothing", {}, "is no Foton filter file"),
        (
            GOOD.replace("# SAMPLING", "# NOTHING"),
            {"sections": [1]},
            "has no sample rate of M0_DAMP_L",
        ),
        (GOOD.replace("2048", "-1"), {"sections": [1]}, "add the line # SAMPLING M0_DAMP_L 16384"),
        (
            GOOD.replace(" 21 3 ", " 21 30 "),
            {"sections": [1]},
            "line 5: has 30 second-order sections",
        ),
        (
            GOOD.replace(" 21 3 ", " 21 x "),
            {"sections": [1]},
            "line 5: has x second-order sections",
        ),
        (
            GOOD.replace(" 21 3 ", " 21 4 "),
            {"sections": [1]},
            "line 8: does not hold the coefficients",
        ),
        (GOOD.replace("    -", "    nan-", 1), {"sections": [1]}, "line 6: does not hold"),
        (
            GOOD.replace("    -", "    -9", 1),
            {"sections": [1]},
            "has a pole outside the unit circle",
        ),
        (GOOD + "#" * 17_000_000, {}, "has more than 16 MB"),
    ],
)
def test_faults_are_one_line(tmp_path, text, changes, says):
    with pytest.raises(InputError) as caught:
        sus.read(design(tmp_path, text, **changes))
    (line,) = str(caught.value).splitlines()
    assert says in line
    assert "my.toml: control.loop.loop-x.filter" in line


def test_text_alone_has_no_files(tmp_path):
    text = design(tmp_path).read_text()
    with pytest.raises(InputError, match="is read only with a design file"):
        sus.parse(text)
