"""Compiled loops are compiled by one process at a time, and loaded by the others."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from suspension_cli import compiled

fcntl = pytest.importorskip("fcntl")


def free(folder):
    """Whether another process could compile now: locks of two open files exclude each other."""
    with open(folder / "lock", "w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
    return True


def test_one_process_compiles(monkeypatch, tmp_path):
    monkeypatch.setattr(compiled, "_FOLDER", str(tmp_path))
    with compiled._one_process():
        with compiled._one_process():  # a loop that calls another one
            assert not free(tmp_path)
        assert not free(tmp_path)
    assert free(tmp_path)


def test_a_folder_that_cannot_be_written(monkeypatch, tmp_path):
    monkeypatch.setattr(compiled, "_FOLDER", str(tmp_path / "missing"))
    with compiled._one_process():
        pass


def test_folders_that_cannot_be_written(monkeypatch, tmp_path):
    """The cache of the user, else a folder for temporary files, else none."""
    home, temporary = tmp_path / "home", tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr(compiled.config, "CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(home))
    monkeypatch.setattr(compiled.tempfile, "tempdir", str(temporary))
    assert compiled._cache_folder().startswith(str(home / "pendsus"))
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null")
    assert compiled._cache_folder().startswith(str(temporary / "pendsus-"))
    monkeypatch.setattr(compiled.tempfile, "tempdir", "/dev/null")
    assert compiled._cache_folder() == ""
    monkeypatch.setattr(compiled.config, "CACHE_DIR", str(tmp_path))
    assert compiled._cache_folder() == str(tmp_path)


def test_loops_of_old_versions_are_removed(monkeypatch, tmp_path):
    monkeypatch.setattr(compiled.config, "CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    for age in range(20):
        old = tmp_path / "pendsus" / f"version-{age}"
        old.mkdir(parents=True)
        os.utime(old, (1e9 - age, 1e9 - age))
    own = compiled._cache_folder()
    kept = {f"version-{age}" for age in range(compiled.VERSIONS - 1)}
    assert {path.name for path in (tmp_path / "pendsus").iterdir()} == {*kept, Path(own).name}


def test_without_a_folder_nothing_is_kept(monkeypatch):
    monkeypatch.setattr(compiled, "_FOLDER", "")
    double = compiled.compiled(lambda x: 2 * x)
    assert double(3.0) == 6.0
    assert not double.stats.cache_hits and not double.stats.cache_path
