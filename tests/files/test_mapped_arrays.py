"""Arrays in files: the same numbers as in memory, and nothing left in the folder."""

from __future__ import annotations

import numpy as np

from suspension_cli.files import mapped_arrays
from suspension_cli.files.mapped_arrays import MAPPED, blocks, copy_column, new_array, release


def filled(folder, rows):
    found = new_array(folder, (rows, 3), "f8")
    for start in range(0, rows, 1000):
        part = found[start : start + 1000]
        part[:] = np.arange(start, start + len(part))[:, None] * [1.0, 2.0, 3.0]
        release(found)
    return found


def test_numbers_outlive_the_memory_that_is_given_back(tmp_path):
    rows = MAPPED + 500
    found = filled(tmp_path, rows)
    assert isinstance(found, np.memmap) == mapped_arrays.CAN_RELEASE
    np.testing.assert_array_equal(copy_column(found, 2), 3.0 * np.arange(rows))
    np.testing.assert_array_equal(found.reshape(-1, 7, 3)[-1, -1], (rows - 1) * np.arange(1, 4))


def test_files_have_no_name_and_few_rows_no_file(tmp_path):
    large = filled(tmp_path, MAPPED)
    assert not [*tmp_path.iterdir()]
    assert len(large) == MAPPED
    assert not isinstance(filled(tmp_path, MAPPED - 1), np.memmap)


def test_blocks_cover_an_array_once(monkeypatch):
    monkeypatch.setattr(mapped_arrays, "BLOCK", 100)
    array = np.arange(35.0)
    parts = [array[part] for part in blocks(array)]
    assert [len(part) for part in parts] == [12, 12, 11]
    np.testing.assert_array_equal(np.concatenate(parts), array)
