"""Large numbers of results are mapped to their file; damaged files are read as before."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from suspension_cli.files import stored
from suspension_cli.files.mapped_arrays import CAN_RELEASE

COUNT = stored.LARGE // 8 + 1


@pytest.mark.skipif(not CAN_RELEASE, reason="arrays are in memory on this system")
def test_large_numbers_are_mapped_and_the_file_stays(tmp_path):
    path = tmp_path / "large.h5"
    values = np.arange(COUNT, dtype=float)
    with h5py.File(path, "w") as file:
        file.create_dataset("a", data=values)
        file.create_dataset("b", data=values, chunks=(1 << 16,))
    with h5py.File(path) as file:
        found = stored.read_values(file["a"])
        in_chunks = stored.read_values(file["b"])
    assert isinstance(found, np.memmap)
    assert not isinstance(in_chunks, np.memmap)
    assert (found == values).all()
    assert (in_chunks == values).all()
    found[0] = 7.0
    with h5py.File(path) as file:
        assert file["a"][0] == 0.0


def test_numbers_of_a_file_in_memory_are_read():
    with h5py.File("memory.h5", "w", driver="core", backing_store=False) as file:
        file.create_dataset("a", data=np.arange(COUNT, dtype=float))
        found = stored.read_values(file["a"])
    assert not isinstance(found, np.memmap)
    assert found[-1] == COUNT - 1
