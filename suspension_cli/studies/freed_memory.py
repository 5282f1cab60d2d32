"""Memory that arrays free, kept for those of the next chunk of builds or of frequencies.

The C library of Linux asks the system for the memory of each large array, and gives it back when
the array is freed. The system clears each page anew, which took a fifth of the time of a chunk of
builds. What counts as large grows with the largest array that was ever freed, up to 32 MB; and
memory is given back from twice that size on (mallopt(3), M_MMAP_THRESHOLD).
"""

from __future__ import annotations

from functools import cache

import numpy as np

LARGEST = 31 << 20
"""Size of arrays, bytes, up to which their memory is kept; twice that is kept in all."""


@cache
def keep_freed_memory() -> None:
    """Keep the memory of freed arrays in this process from now on; it is not used before."""
    np.empty(LARGEST, dtype=np.uint8)
