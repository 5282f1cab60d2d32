"""Compiled loops: the settings of the compiler, and linear algebra of small symmetric matrices.

Batches of builds are computed by loops over the builds that `numba` compiles when they are first
called, and keeps on disk. Importing numba takes half a second, so only code that computes batches
imports this module.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import math
import os
import shutil
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numba import config as _config
from numba import njit, types
from numba.core import event
from numba.extending import intrinsic, overload

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact, Int
    from llvmlite.ir import IRBuilder, Value
    from numba.core.typing.context import Context
    from numba.core.typing.templates import Signature

config: Any = _config  # numba sets its attributes when it is imported

Loop = TypeVar("Loop", bound=Callable[..., object])

VERSIONS = 8
"""Number of versions of the program whose compiled loops are kept, some 15 MB each."""


def _cache_folder() -> str:
    """Folder for compiled loops, new after any change of the code; "" if none can be written."""
    if config.CACHE_DIR and _is_writable(Path(config.CACHE_DIR)):
        return config.CACHE_DIR
    # numba does not notice that something in another file changed
    here = Path(__file__).parent
    constants = [here / "elements" / "beam.py", here / "equilibrium" / "residual_scale.py"]
    files = (*sorted(here.rglob("compiled*.py")), *constants)
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()[:16]
    with contextlib.suppress(RuntimeError):  # a user without home
        home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        folder = home / "pendsus" / digest
        new = not folder.exists()
        if _is_writable(folder):
            if new:
                _remove_old(folder.parent)
            return str(folder)
    with contextlib.suppress(OSError):
        user = os.getuid() if hasattr(os, "getuid") else 0
        shared = Path(tempfile.gettempdir()) / f"pendsus-{user}-{digest}"
        # what is loaded from there is executed
        if _is_writable(shared) and shared.stat().st_uid == user:
            return str(shared)
    return ""


def _remove_old(parent: Path) -> None:
    """Keep the compiled loops of the last versions of the program only."""
    with contextlib.suppress(OSError):
        folders = sorted(parent.iterdir(), key=lambda path: path.stat().st_mtime)
        for old in folders[:-VERSIONS]:
            shutil.rmtree(old, ignore_errors=True)


def _is_writable(folder: Path) -> bool:
    """Whether files can be written to a folder, which is made if missing."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


_FOLDER = _cache_folder()
_THREADS = threading.RLock()
_depth = 0


@contextlib.contextmanager
def _one_process() -> Iterator[None]:
    """Let one process at a time compile: the others wait, and load what it has kept."""
    global _depth
    with _THREADS, contextlib.ExitStack() as stack:
        if not _depth and _FOLDER and fcntl is not None:
            # a folder that cannot be written any more, or a file system without locks
            with contextlib.suppress(OSError):
                file = stack.enter_context(open(Path(_FOLDER) / "lock", "w"))
                fcntl.flock(file, fcntl.LOCK_EX)
                # explicitly: a process forked meanwhile keeps the file open
                stack.callback(fcntl.flock, file, fcntl.LOCK_UN)
        _depth += 1
        try:
            yield
        finally:
            _depth -= 1


def compiled(function: Loop) -> Loop:
    """Compile a function when it is first called, and keep it on disk where that is possible."""
    before, config.CACHE_DIR = config.CACHE_DIR, _FOLDER
    try:
        made: Any = njit(cache=bool(_FOLDER), error_model="numpy", nogil=True)(function)
    finally:
        config.CACHE_DIR = before
    compile_or_load = made.compile

    def compile_alone(signature: object) -> object:
        with _one_process():
            return compile_or_load(signature)

    made.compile = compile_alone
    return _without_literals(made)


def inlined(function: Loop) -> Loop:
    """Compile a small function into each compiled function that calls it."""
    # only compiled code calls it: it needs no wrappers for calls from Python and C
    uncalled: Any = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return _without_literals(njit(error_model="numpy", forceinline=True, **uncalled)(function))


def _without_literals(made: Any) -> Any:
    """Compile a function once, not again for every literal number in a call of it."""
    template = made.get_call_template

    def general_template(args: tuple[types.Type, ...], kws: dict[str, types.Type]) -> object:
        keywords = {name: types.unliteral(kind) for name, kind in kws.items()}
        return template(tuple(types.unliteral(kind) for kind in args), keywords)

    made.get_call_template = general_template
    return made


def constant(
    array: Inexact[np.ndarray, "*shape"], shape: tuple[int, ...] | None = None
) -> Inexact[np.ndarray, "*wanted"]:
    """Contiguous array, broadcast to a shape, that cannot be written.

    A loop is compiled for each kind of array, so all arrays that loops only read are made alike.
    """
    if shape is not None and array.shape != shape:
        array = np.broadcast_to(array, shape)
    result = np.ascontiguousarray(array).view()
    result.flags.writeable = False
    return result


def _keep_memory() -> None:
    """Let the C library (glibc) keep freed arrays for the next batch.

    Otherwise it returns them to the system, which fills each page with zeros when it is used again:
    up to a quarter of the time of a batch.
    """
    trim_threshold, mmap_threshold = -1, -3  # malloc.h
    with contextlib.suppress(AttributeError, OSError):
        library = ctypes.CDLL(None)
        library.mallopt(trim_threshold, 1 << 28)
        library.mallopt(mmap_threshold, 1 << 25)


_keep_memory()


class _Announcement(event.Listener):
    """Tell a user at a terminal once that loops are being compiled, since that takes a while."""

    def __init__(self) -> None:
        self.made = False

    def on_start(self, event: event.Event) -> None:
        """At the first function that is compiled, not loaded from disk."""
        del event
        if not self.made and sys.stderr.isatty():
            self.made = True
            print("compiling the loops over builds (once, some 30 s)", file=sys.stderr)

    def on_end(self, event: event.Event) -> None:
        """Do nothing."""


event.register("numba:compile", _Announcement())


@compiled
def factorise(
    matrix: Inexact[np.ndarray, "first+row first+row"],
    factor: Inexact[np.ndarray, "row row"],
    pivot: Inexact[np.ndarray, " row"],
    where: Int[np.ndarray, " row"],
    kept: int,
    first: int,
) -> float:
    """Factorise L D L^T from the lower triangle of a symmetric matrix (n, n), real or complex.

    The `first` rows and columns of the matrix are left out.

    Columns are eliminated from the last to the first; zeros cost nothing. `factor` (n, n) is
    filled with the rows of L^T D below the diagonal and 1/D on it, `pivot` (n,) with D; `where`
    (n,) is scratch. The first `kept` columns are not eliminated: the lower triangle of `factor`
    then has their Schur complement.

    Returns
    -------
    float
        Smallest size of a pivot relative to the element of the matrix on the diagonal.
    """
    size = len(pivot)
    for i in range(size):
        for j in range(i + 1):
            factor[i, j] = matrix[first + i, first + j]
    least = np.inf
    for k in range(size - 1, kept - 1, -1):
        d = factor[k, k]
        pivot[k] = d
        ratio = _square(d) / _square(matrix[first + k, first + k])
        if not ratio >= least:
            least = ratio
        over = 1 / d
        factor[k, k] = over
        count = 0
        for i in range(k):
            if factor[k, i] != 0.0:
                where[count] = i
                count += 1
        sparse = 2 * count < k
        # elements are indexed one by one: a view of a row costs more than the row
        for m in range(count):
            i = where[m]
            scaled = factor[k, i] * over
            if sparse:
                for n in range(m + 1):
                    factor[i, where[n]] -= scaled * factor[k, where[n]]
            else:
                for j in range(i + 1):
                    factor[i, j] -= scaled * factor[k, j]
    return math.sqrt(least)


@inlined
def _square(number: complex) -> float:
    """Square of the size of a real or complex number."""
    return number.real * number.real + number.imag * number.imag


@compiled
def substitute(factor: Inexact[np.ndarray, "row row"], x: Inexact[np.ndarray, " row"]) -> None:
    """Solve with the factors of `factorise`, x (n,) in place of the right-hand side."""
    size = len(x)
    for k in range(size - 1, -1, -1):
        value = x[k] * factor[k, k]
        x[k] = value
        if value != 0.0:
            for i in range(k):
                x[i] -= factor[k, i] * value
    for k in range(size):
        # four sums at once, since each addition has to wait for the one before it
        a = b = c = d = x[k] * 0
        for i in range(0, k - 3, 4):
            a += factor[k, i] * x[i]
            b += factor[k, i + 1] * x[i + 1]
            c += factor[k, i + 2] * x[i + 2]
            d += factor[k, i + 3] * x[i + 3]
        for i in range(k - k % 4, k):
            a += factor[k, i] * x[i]
        x[k] -= ((a + b) + (c + d)) * factor[k, k]


def _multiply_add(
    context: Context, a: types.Type, b: types.Type, c: types.Type
) -> tuple[Signature, Callable[..., Value | None]]:
    """Compute a b + c with one rounding."""

    def instruction(
        _context: Context, builder: IRBuilder, _signature: Signature, numbers: list[Value]
    ) -> Value | None:
        return builder.fma(*numbers)

    del context, a, b, c
    return types.float64(*(types.float64,) * 3), instruction


_fused: Any = intrinsic(_multiply_add)


@inlined
def _add_product(high: float, low: float, a: float, b: float) -> tuple[float, float]:
    """Add a b to a sum in two doubles: error-free product and sum (Knuth)."""
    product = a * b
    error = _fused(a, b, -product)
    total = high + product
    t = total - high
    return total, low + error + ((high - (total - t)) + (product - t))


@compiled
def _subtract_product(
    matrix: Float[np.ndarray, "row row"],
    x: Float[np.ndarray, " row"],
    sign: float,
    high: Float[np.ndarray, " row"],
    low: Float[np.ndarray, " row"],
) -> None:
    """Subtract `sign` A x from `high` + `low`, A (n, n) real, given by its lower triangle."""
    for i in range(len(x)):
        own_high, own_low = _add_product(high[i], low[i], -sign * matrix[i, i], x[i])
        for j in range(i):
            element = -sign * matrix[i, j]
            if element != 0.0:
                own_high, own_low = _add_product(own_high, own_low, element, x[j])
                high[j], low[j] = _add_product(high[j], low[j], element, x[i])
        high[i], low[i] = own_high, own_low


def residual(
    matrix: Inexact[np.ndarray, "row row"],
    x: Inexact[np.ndarray, " row"],
    right: Inexact[np.ndarray, " row"],
    work: Float[np.ndarray, "2 row"],
    result: Inexact[np.ndarray, " row"],
) -> None:
    """Residual (n,), b - A x, of a real or complex system, in twice the digits.

    `work` (2, n) is scratch.
    """


@overload(residual)
def _residual(
    matrix: Inexact[np.ndarray, "row row"],
    x: Inexact[np.ndarray, " row"],
    right: Inexact[np.ndarray, " row"],
    work: Float[np.ndarray, "2 row"],
    result: Inexact[np.ndarray, " row"],
) -> Callable[..., None]:
    """Choose by the type of the numbers, at compile time.

    numba passes types of arrays here, but wants the annotations of the functions to choose from.
    """
    if isinstance(matrix.dtype, types.Complex):
        return _complex_residual
    return _real_residual


def _real_residual(
    matrix: Inexact[np.ndarray, "row row"],
    x: Inexact[np.ndarray, " row"],
    right: Inexact[np.ndarray, " row"],
    work: Float[np.ndarray, "2 row"],
    result: Inexact[np.ndarray, " row"],
) -> None:
    high, low = work[0], work[1]
    for i in range(len(x)):
        high[i], low[i] = right[i], 0.0
    _subtract_product(matrix, x, 1.0, high, low)
    for i in range(len(x)):
        result[i] = high[i] + low[i]


def _complex_residual(
    matrix: Inexact[np.ndarray, "row row"],
    x: Inexact[np.ndarray, " row"],
    right: Inexact[np.ndarray, " row"],
    work: Float[np.ndarray, "2 row"],
    result: Inexact[np.ndarray, " row"],
) -> None:
    high, low = work[0], work[1]
    for i in range(len(x)):
        high[i], low[i] = right[i].real, 0.0
    _subtract_product(np.real(matrix), np.real(x), 1.0, high, low)
    _subtract_product(np.imag(matrix), np.imag(x), -1.0, high, low)
    for i in range(len(x)):
        result[i] = high[i] + low[i]
    for i in range(len(x)):
        high[i], low[i] = right[i].imag, 0.0
    _subtract_product(np.real(matrix), np.imag(x), 1.0, high, low)
    _subtract_product(np.imag(matrix), np.real(x), 1.0, high, low)
    for i in range(len(x)):
        result[i] += 1j * (high[i] + low[i])


@compiled
def least_pivots(
    matrix: Float[np.ndarray, "build 6+coordinate 6+coordinate"],
    mass: Float[np.ndarray, "build 6+coordinate 6+coordinate"],
    rigid: float,
    result: Float[np.ndarray, " build"],
) -> None:
    """Least pivot of K + c M of many builds, relative to its diagonal: positive if stable.

    The shift c is `rigid` times the sum of K/M over the coordinates with mass, to cover rounding.

    Parameters
    ----------
    matrix, mass : (p, N, N) arrays
        With the six coordinates of the support, which are left out.
    result : (p,) array
        To be filled; not positive where a number is not finite.
    """
    size = matrix.shape[-1] - 6
    shifted, factor = np.empty((size, size)), np.zeros((size, size))
    pivot, where = np.empty(size), np.empty(size, dtype=np.int64)
    for p in range(len(matrix)):
        shift = 0.0
        for i in range(6, size + 6):
            if mass[p, i, i] > 0:
                shift += rigid * abs(matrix[p, i, i]) / mass[p, i, i]
        for i in range(size):
            for j in range(i + 1):
                shifted[i, j] = matrix[p, i + 6, j + 6] + shift * mass[p, i + 6, j + 6]
        factorise(shifted, factor, pivot, where, 0, 0)
        least = np.inf
        for i in range(size):
            relative = pivot[i] / abs(shifted[i, i])
            if not relative >= least:
                least = relative
        result[p] = least
