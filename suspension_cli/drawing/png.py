"""PNG files of pixels.

Format: PNG (Portable Network Graphics) Specification, third edition, W3C 2025.
"""

from __future__ import annotations

import struct
import zlib

import numpy as np

from suspension_cli.scene.arrays import Array

LEVEL = 3
"""Level of compression: higher ones save a tenth of the size and double the time."""


def encode_png(pixels: Array, dpi: float, software: str) -> bytes:
    """Encode pixels as PNG; several times as fast as with filters, which drawings gain nothing by.

    Parameters
    ----------
    pixels : (rows, columns, 3 or 4) array of uint8
        Red, green, blue; anything after these is ignored.
    dpi : float
        Resolution, dots per inch.
    software : str
        Name of the program, stored in the file.
    """
    rows, columns = pixels.shape[:2]
    lines = np.empty((rows, 3 * columns + 1), np.uint8)
    lines[:, 0] = 0  # number of the filter: none
    for colour in range(3):
        lines[:, 1 + colour :: 3] = pixels[:, :, colour]
    packer = zlib.compressobj(LEVEL, memLevel=9)
    per_metre = round(dpi / 0.0254)
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        _chunk(kind, data)
        for kind, data in (
            (b"IHDR", struct.pack(">IIBBBBB", columns, rows, 8, 2, 0, 0, 0)),
            (b"pHYs", struct.pack(">IIB", per_metre, per_metre, 1)),
            (b"tEXt", b"Software\0" + software.encode("latin-1")),
            (b"IDAT", packer.compress(lines.data) + packer.flush()),
            (b"IEND", b""),
        )
    )


def _chunk(kind: bytes, data: bytes) -> bytes:
    """Make a chunk: length, kind, data, checksum."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
