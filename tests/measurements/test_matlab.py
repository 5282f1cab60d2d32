"""MATLAB files of data: vectors, fields of structures, and files that are not what they say."""

from __future__ import annotations

import io
import struct
import zlib

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from suspension_cli.errors import InputError
from suspension_cli.files import data_files
from suspension_cli.files.columns import Columns
from suspension_cli.measurements.read import read_bare

F = np.array([0.5, 1.0, 2.0])
H = np.array([1 + 2j, 3 - 1j, 0.5j])


@pytest.mark.parametrize("compressed", [False, True])
def test_a_transfer_function(compressed, tmp_path):
    """Rows and columns alike."""
    path = tmp_path / "tf.mat"
    savemat(path, {"f": F, "h": H[:, None], "note": "mine"}, do_compression=compressed)
    [found] = read_bare(path)
    assert found.frequency.tolist() == F.tolist()
    assert found.value == pytest.approx(H)


def test_version_7_3_is_hdf5(tmp_path):
    """With a block of 512 bytes before it, as MATLAB writes it."""
    path = tmp_path / "tf.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["f"] = F
        file["h"] = H
    data = path.read_bytes()
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + data[512:])
    [found] = read_bare(path)
    assert found.value == pytest.approx(H)


def test_variables_are_listed(tmp_path):
    """In the message that asks for one."""
    path = tmp_path / "mine.mat"
    savemat(path, {"noise": {"f": F, "one": F, "two": F}})
    source = data_files.open_data_file(path)
    assert isinstance(source, Columns)
    assert source.names == ["noise.f", "noise.one", "noise.two"]
    with pytest.raises(InputError, match=r"names no variable; did you mean 'noise.two'"):
        source.find("column", "noise.twoo")


def test_a_bomb_is_refused_before_it_is_expanded(tmp_path):
    """By the size that it declares."""
    plain = io.BytesIO()
    savemat(plain, {"x": F})
    head = plain.getvalue()[:128]
    inner = struct.pack("<II", 14, 2_000_000_000) + bytes(100)
    packed = zlib.compress(inner)
    path = tmp_path / "bomb.mat"
    path.write_bytes(head + struct.pack("<II", 15, len(packed)) + packed)
    with pytest.raises(InputError, match="holds more than 256 MB of numbers"):
        data_files.open_data_file(path)


@pytest.mark.parametrize("cut", [0, 20, 128, 150, -5])
def test_damage_is_one_line(cut, tmp_path):
    """Empty, cut off, or no numbers."""
    path = tmp_path / "cut.mat"
    savemat(path, {"f": F, "h": H})
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(InputError) as caught:
        data_files.open_data_file(path)
    assert len(caught.value.faults) == 1
