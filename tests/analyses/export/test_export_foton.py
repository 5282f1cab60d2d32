"""Plants as filter files of front ends: read back, their digital responses are within the error
that the file states."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

import suspension_cli as sus
from suspension_cli.analyses.export.solve import off_resonance
from suspension_cli.design import foton, foton_file
from suspension_cli.files.hdf5 import read_design
from tests.support import plants
from tests.support.commandline import run, strict_json, written
from tests.support.foton import written_response
from tests.support.paths import CONFIGS

BAND = (0.1, 100.0)


def coefficients(path, module):
    """Second-order sections (scipy) of all sections of a module, from the lines of the file."""
    rows = []
    for line in path.read_text().splitlines():
        words = line.split()
        if line.startswith(f"{module} "):
            gain, words, wanted = float(words[7]), words[8:], int(words[3])
        elif not line.startswith("    ") or not wanted:
            wanted = 0
            continue
        a1, a2, b1, b2 = map(float, words)
        rows.append(np.array([1, b1, b2, 1, a1, a2]))
        rows[-1][:3] *= gain
        gain, wanted = 1.0, wanted - 1
    return np.array(rows)


@pytest.mark.parametrize(
    ("kind", "options", "rate"),
    [
        ("triple", [], 16384.0),
        ("triple", ["--loss", "--band", "0.1:30"], 2048.0),
        ("quadruple", ["--loss", "--input", "support.x", "--output", "test.x"], 16384.0),
    ],
)
def test_read_back_within_the_stated_error(tmp_path, kind, options, rate):
    ends = ["--input", "upper.force_x", "--output", "test.x", "--output", "test.pitch"]
    args = [*(options if "--input" in options else [*options, *ends]), "--rate", rate]
    file = written(tmp_path, plants.raw(kind, loss=True))
    out = run("export", file, "--format", "foton", "--json", "--out", tmp_path / "out", *args)
    assert out.exit_code == 0, out.stderr
    document = strict_json(out.stdout)
    (path,) = (tmp_path / "out").glob("*-foton.txt")
    low, high = (0.1, 30.0) if "0.1:30" in options else BAND
    f = np.geomspace(low, high, 801)
    plant = sus.export(
        sus.read(file),
        loss="--loss" in options,
        band=f"{low}:{high}",
        inputs=document["input"],
        outputs=document["output"],
    )
    text = path.read_text()
    assert len(document["modules"]) == len(document["output"])
    for n, one in enumerate(document["modules"]):
        assert one["error"] < 0.01
        stated = (
            f"# {one['output']} over {one['input']}, SI; relative error {one['error']:.2g} from"
        )
        assert stated in text
        numbers = range(1, one["sections"] + 1)
        design, found = foton_file.read(path, one["module"], numbers)
        assert found == rate
        own = foton.parse(design, found).at(f)
        exact = plant.system.at(f)[:, n, 0]
        error = off_resonance(np.abs(own / exact - 1)[:, None, None], f).max()
        assert error == pytest.approx(one["error"], rel=1e-3)
        rows = coefficients(path, one["module"])
        assert len(rows) <= 10 * one["sections"]
        np.testing.assert_allclose(own, signal.sosfreqz(rows, f, fs=rate)[1], rtol=1e-4)


def designs(path, module):
    """Design strings of the sections of a module, from the comments of the file."""
    lines = path.read_text().replace(" \\\n#    ", "").splitlines()
    return [line.split(maxsplit=4)[4] for line in lines if line.startswith(f"# DESIGN   {module}")]


def test_a_plant_with_a_zero_in_the_right_half_plane(tmp_path):
    """Pitch of the quadruple's mirror has one: Foton divides by its modulus, as it does here."""
    file = CONFIGS / "built" / "ligo-quad.toml"
    ends = ("--input", "penultimate.force_x", "--output", "test.pitch")
    assert run("export", file, "--format", "foton", "--out", tmp_path, *ends).exit_code == 0
    (path,) = tmp_path.glob("*-foton.txt")
    module, f = "TEST_PITCH_PENULTIMATE_FORCE_X", np.geomspace(0.1, 100, 200)
    texts = [text.replace(" ", "") for text in designs(path, module)]
    assert sum("[-" in text or ";-" in text for text in texts)
    written = np.prod([written_response(text, f, 16384.0) for text in texts], axis=0)
    read = np.prod([foton.parse(text, 16384.0).at(f) for text in texts], axis=0)
    of_lines = signal.sosfreqz(coefficients(path, module), f, fs=16384.0)[1]
    np.testing.assert_allclose(written, read, rtol=1e-9)
    np.testing.assert_allclose(written, of_lines, rtol=1e-4)
    plant = sus.export(sus.read(file), inputs=[ends[1]], outputs=[ends[3]]).system.at(f).ravel()
    assert np.median(np.abs(written / plant - 1)) < 1e-3


def test_a_loop_around_an_exported_filter(tmp_path):
    """The design string in a comment of the file, made digital, is the filter of its lines."""
    file = written(tmp_path, plants.raw("double", loss=True))
    ends = ("--input", "upper.force_z", "--output", "test.z", "--loss")
    assert run("export", file, "--format", "foton", "--out", tmp_path, *ends).exit_code == 0
    (path,) = tmp_path.glob("*-foton.txt")
    text = path.read_text()
    (design,) = designs(path, "TEST_Z_UPPER_FORCE_Z")
    f = np.geomspace(0.1, 3000, 50)
    of_lines = foton.parse(*foton_file.read(path, "TEST_Z_UPPER_FORCE_Z", [1])).at(f)
    np.testing.assert_allclose(foton.parse(design, 16384.0).at(f), of_lines, rtol=1e-5)
    assert read_design(path) == sus.read(file).text
    assert max(map(len, text.splitlines())) < 1000  # front ends read no longer lines


def test_saved_from_python(tmp_path):
    made = sus.export(sus.example("double"), inputs=["upper.force_z"], outputs=["test.z"])
    made.save(tmp_path / "x.txt")
    assert "# MODULES TEST_Z_UPPER_FORCE_Z" in (tmp_path / "x.txt").read_text()


def test_a_rate_below_the_band(tmp_path):
    file = written(tmp_path, plants.raw("double"))
    result = run("export", file, "--format", "foton", "--rate", "300", "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert "--rate = 300: is not four times the end of the band, 100 Hz" in result.stderr
    assert not (tmp_path / "out").exists()
