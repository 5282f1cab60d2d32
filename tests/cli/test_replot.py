"""`pendsus plot`: a results file alone gives the picture again."""

from __future__ import annotations

import pytest

from tests.support.commandline import assert_refused, run, written
from tests.support.designs import TEXTS

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


def test_default_is_beside_the_file(results, tmp_path):
    copy = tmp_path / "renamed.h5"
    copy.write_bytes((results / "double-modes.h5").read_bytes())
    assert run("plot", copy, "-q").stderr == ""
    assert sorted(path.name for path in tmp_path.iterdir()) == ["renamed.h5", "renamed.png"]


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
