"""Compiled loops are compiled by one process at a time, and loaded by the others."""

from __future__ import annotations

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
