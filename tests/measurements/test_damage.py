"""Damaged, hostile and endless files of data are refused in one line, before they take memory."""

from __future__ import annotations

import gzip
import os
import random
from pathlib import Path

import h5py
import numpy as np
import pytest

from suspension_cli.files import whole_files
from tests.measurements.test_read import HEAD, F, H, refusal
from tests.support.dtt_files import document, result

DTT = document(result(0, "TransferFunction", 0, H, ["A", "B"]))
ENTITIES = '<!DOCTYPE LIGO_LW [<!ENTITY a "b">]><LIGO_LW>&a;</LIGO_LW>'


def declare(encoding: str) -> bytes:
    return f'<?xml version="1.0" encoding="{encoding}"?><LIGO_LW/>'.encode()


@pytest.mark.parametrize(
    ("data", "says"),
    [
        *[
            (declare(encoding), "is not XML")
            for encoding in ("foo", "cp932", "utf-7", "idna", "undefined")
        ],
        (f'<?xml version="1.0"?>{ENTITIES}'.encode(), "defines XML entities"),
        (f'<?xml version="1.0" encoding="utf-16"?>{ENTITIES}'.encode("utf-16"), "defines XML"),
        (b"<LIGO_LW>" * 100_000, "is not XML (too many elements)"),
        (b"<LIGO_LW>" + b"<a/>" * 1_000_001 + b"</LIGO_LW>", "is not XML (too many elements)"),
        (gzip.compress(DTT.encode(), mtime=0)[:-40], "is not whole gzip"),
        (b"\x1f\x8b\x08" + bytes(7) + b"\xff" * 99, "is not whole gzip"),
        (gzip.compress(b"<" + bytes(whole_files.DATA), mtime=0), "has more than 256 MB"),
        (DTT.replace('"f0">0.0', '"f0">inf').encode(), 'point 1 of B/A: trace "frequ'),
    ],
    ids=lambda value: value[:20].decode(errors="replace") if isinstance(value, bytes) else "",
)
def test_xml(data, says, tmp_path):
    (tmp_path / "data.xml").write_bytes(data)
    assert refusal(tmp_path / "data.xml").startswith(says)


def outside(file: h5py.File) -> None:
    file.create_dataset("value", (3,), "c16", external=[("/etc/hostname", 0, 48)])


def virtual(file: h5py.File) -> None:
    layout = h5py.VirtualLayout((3,), "c16")
    layout[:] = h5py.VirtualSource("other.h5", "value", (3,))
    file.create_virtual_dataset("value", layout)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (outside, 'keeps "/value" in another file'),
        (virtual, 'keeps "/value" in another file'),
        (lambda file: file.create_dataset("value", (4_000_000_000,), "f8", chunks=(1000,)),
         'is damaged: "/value" should have 4000000000 values'),
        (lambda file: file.create_dataset("value", data=H).attrs.update(x0=[1.0, 2.0], dx=1.0),
         "value.x0: must be one number"),
        (lambda file: file.create_dataset("value", data=H).attrs.update(x0="1", dx=1.0),
         "value.x0: must be one number"),
        (lambda file: file.create_dataset("value", data=H).attrs.update(x0=np.inf, dx=1.0),
         'element 0: dataset "frequency" holds inf'),
        (lambda file: file.update({"value": h5py.ExternalLink("/etc/hostname", "/x")}),
         "has no one-dimensional dataset"),
    ],
)  # fmt: skip
def test_hdf5(change, says, tmp_path):
    with h5py.File(tmp_path / "data.h5", "w") as file:
        change(file)
    assert refusal(tmp_path / "data.h5").startswith(says)


@pytest.mark.parametrize("seed", range(10))
def test_flipped_bytes(seed, tmp_path):
    """What can still be read has numbers, what cannot is refused."""
    draw = random.Random(seed)
    with h5py.File(tmp_path / "data.h5", "w") as file:
        file["frequency"] = F
        file.create_dataset("value", data=H, compression="gzip")
    data = bytearray((tmp_path / "data.h5").read_bytes())
    for place in draw.sample(range(8, len(data)), 200):
        data[place] ^= 1 << draw.randrange(8)
    (tmp_path / "data.h5").write_bytes(data)
    assert refusal(tmp_path / "data.h5")


def test_files_without_end(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    for path in (tmp_path / "pipe.csv", Path("/dev/zero")):
        assert refusal(path).startswith("is not a regular file")
    with (tmp_path / "large.csv").open("w") as file:
        file.write(HEAD)
        file.truncate(10**12)  # a hole
    assert refusal(tmp_path / "large.csv").startswith("has more than 64 MB")
