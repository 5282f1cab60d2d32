"""`pendsus plot`: a results file alone gives the picture again."""

from __future__ import annotations

import pytest

from tests.support.commandline import assert_refused, from_template, run, written
from tests.support.designs import TEXTS
from tests.support.golden import configs

PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A folder with the modes of a design, its design file gone."""
    folder = tmp_path_factory.mktemp("results")
    design = written(folder, TEXTS["double"])
    assert run("modes", design, "--json", "--plot", "--out", folder).exit_code == 0
    design.unlink()
    return folder


def test_redraws_from_the_file_alone(results, tmp_path):
    result = run("plot", results / "double-modes.h5", "--out", tmp_path / "again")
    assert result.exit_code == 0, result.stderr
    assert result.stdout == ""
    assert result.stderr == f"wrote {tmp_path / 'again' / 'double-modes.png'}\n"
    picture = (tmp_path / "again" / "double-modes.png").read_bytes()
    assert picture.startswith(PNG)
    assert picture == (results / "double-modes.png").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "stem"),
    [
        (("xcouple", "figure6", "--sweep", "k=0.9:1.1:5,offset"), "husman2000-figure6-xcouple"),
        (
            ("xcouple", "figure6", "--sweep", "k=0.9,1.1", "--frequency", "1:100:20"),
            "husman2000-figure6-xcouple",
        ),
        (("xcouple", "figure6", "--matrix"), "husman2000-figure6-xcouple-matrix"),
    ],
)
def test_redraws_sweeps(arguments, stem, tmp_path):
    command, design, *rest = arguments
    file = next(path for path in configs() if path.stem == design)
    assert run(command, file, *rest, "--workers", "1", "--out", tmp_path).exit_code == 0
    first = (tmp_path / f"{stem}.png").read_bytes()
    (tmp_path / f"{stem}.png").unlink()
    result = run("plot", tmp_path / f"{stem}.h5")
    assert result.exit_code == 0, result.stderr
    assert (tmp_path / f"{stem}.png").read_bytes() == first


def test_default_is_beside_the_file(results, tmp_path):
    copy = tmp_path / "renamed.h5"
    copy.write_bytes((results / "double-modes.h5").read_bytes())
    assert run("plot", copy, "-q").stderr == ""
    assert sorted(path.name for path in tmp_path.iterdir()) == ["renamed.h5", "renamed.png"]


def test_redraws_a_response(tmp_path):
    file = from_template(tmp_path)
    assert (
        run("response", file, "--json", "--frequency", "1:10:20", "--out", tmp_path).exit_code == 0
    )
    assert run("plot", tmp_path / "single-response.h5").exit_code == 0
    assert (tmp_path / "single-response.png").read_bytes().startswith(PNG)


@pytest.mark.parametrize(
    "content", [b"", b"no HDF5", TEXTS["single"].encode()], ids=["empty", "prose", "toml"]
)
def test_no_results(content, tmp_path):
    file = written(tmp_path, content, "x.h5")
    [line] = assert_refused(run("plot", file), file)
    assert line.startswith("is not HDF5")
    assert [path.name for path in tmp_path.iterdir()] == ["x.h5"]


def test_truncated_results(results, tmp_path):
    file = written(tmp_path, (results / "double-modes.h5").read_bytes()[:9000], "x.h5")
    assert_refused(run("plot", file), file)


def test_missing_results_and_folders(tmp_path):
    [line] = assert_refused(run("plot", tmp_path / "x.h5"), tmp_path / "x.h5")
    assert line.startswith("is missing")
    assert_refused(run("plot", tmp_path), tmp_path)
