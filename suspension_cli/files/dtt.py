"""Transfer functions and spectra in XML files of the LIGO diagnostics test tools (diaggui).

A file is a LIGO_LW document. Each ``<LIGO_LW Name="Result[n]">`` (a stored trace: ``Reference[n]``)
has parameters `Subtype`, `f0`, `df`, `N` (frequencies), `M` (traces), `Averages`, `ChannelA` and
``ChannelB[m]``, and one base64 stream of single-precision numbers:

- `TransferFunction` of swept sines: of subtype 0, M x N complex values B/A at f0 + n df; of 3 and
  6, N frequencies and then these. Subtypes 2, 5, 7 are the same of coherence.
- `Spectrum` of Fourier tools: of subtype 1, the amplitude spectral density of A (not its square);
  of 2, M x N complex cross spectra of A and conj(B); of 3, M x N coherences. Subtypes 5, 6, 7 are
  the same, after their frequencies.

From spectra B/A is conj(P_AB)/ASD_A^2.
"""

from __future__ import annotations

import base64
import binascii
import gzip
import io
import re
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np

from suspension_cli.errors import Fault, InputError, format_value, one_line, suggest
from suspension_cli.files import whole_files
from suspension_cli.files.columns import Columns

AGAIN = "save the measurement in diaggui again"
"""Remedy for a damaged file."""
LISTED = 12
"""Most channels that a message lists."""
MAX_ELEMENTS = 1_000_000
"""Most elements of an XML file; that of a large measurement has thousands."""
MAX_DEPTH = 50
"""Deepest nesting of its elements; that of a measurement is six."""
Pair = tuple[str, str]
"""Channels (input, output)."""
CONTENTS = {
    ("TransferFunction", "0"): ("transfer", "none"),
    ("TransferFunction", "3"): ("transfer", "first"),
    ("TransferFunction", "6"): ("transfer", "double"),
    ("TransferFunction", "2"): ("coherence", "none"),
    ("TransferFunction", "5"): ("coherence", "first"),
    ("TransferFunction", "7"): ("coherence", "double"),
    ("Spectrum", "1"): ("amplitude", "none"),
    ("Spectrum", "5"): ("amplitude", "first"),
    ("Spectrum", "2"): ("cross", "none"),
    ("Spectrum", "6"): ("cross", "first"),
    ("Spectrum", "3"): ("coherence", "none"),
    ("Spectrum", "7"): ("coherence", "first"),
}
"""Content of results by type and subtype, and where their frequencies are: nowhere, in the first
row, or before the rows in double precision."""


class Trace(NamedTuple):
    """Frequencies (Hz), values, and the number of averages."""

    frequency: np.ndarray
    value: np.ndarray
    averages: float | None


@dataclass(frozen=True)
class Dtt:
    """Transfer functions and coherences of one DTT file, by channels (input, output).

    `amplitude` are the amplitude spectral densities, by channel.
    """

    transfer: dict[Pair, Trace]
    coherence: dict[Pair, Trace]
    amplitude: dict[str, Trace]

    @property
    def spectra(self) -> Columns:
        """Frequencies, and the densities of all channels that have the same; see `columns`."""
        if not self.amplitude:
            problem = "has no amplitude spectral density"
            raise InputError.of("", problem, "measure a power spectrum, or export it")
        first = next(iter(self.amplitude.values())).frequency
        good = first > 0  # a spectrum says nothing at 0 Hz
        held = {"frequency": first[good]} | {
            name: trace.value[good]
            for name, trace in self.amplitude.items()
            if np.array_equal(trace.frequency, first)
        }
        place = lambda n: f"point {n + 1}"  # noqa: E731
        return Columns([*held], [*held.values()].__getitem__, place, noun="channel")

    def columns(self, into: str | None, out: str | None) -> Columns:
        """Return the transfer function between two channels, and its coherence.

        A channel is None or "" if the other (or the file) determines it. Raises `InputError` with
        the channels of the file if there is none, or several.
        """
        pair = self._pair(into, out)
        found = self.transfer[pair]
        held = {"frequency": found.frequency, "value": found.value}
        coherence = self.coherence.get(pair) or self.coherence.get((pair[1], pair[0]))
        if coherence is not None and len(coherence.value) == len(found.value):
            held["coherence"] = coherence.value
        # an aborted sweep ends in frequencies of 0, and a spectrum says nothing there
        order = np.argsort(found.frequency, kind="stable")
        order = order[found.frequency[order] > 0]
        kept = [values[order] for values in held.values()]
        place = lambda n: f"point {order[n] + 1} of {pair[1]}/{pair[0]}"  # noqa: E731
        return Columns([*held], kept.__getitem__, place, noun="trace", averages=found.averages)

    def _pair(self, into: str | None, out: str | None) -> Pair:
        pairs = [*self.transfer]
        if not pairs:
            problem = "has no transfer function and no cross spectra with their power spectra"
            raise InputError.of("", problem, "measure a transfer function, or export it")
        for n, (role, name) in enumerate((("input", into), ("output", out))):
            known = sorted({pair[n] for pair in pairs})
            if name and name not in known:
                problem = f"is the {role} of no transfer function in the file"
                remedy = suggest(name, known)
                raise InputError.of(f"{role}_channel", problem, remedy, format_value(name))
        fitting = [(a, b) for a, b in pairs if a == (into or a) and b == (out or b)]
        if len(fitting) == 1:
            return fitting[0]
        if fitting:
            inputs = _listed(a for a, _ in fitting)
            outputs = _listed(b for _, b in fitting)
            problem = f"the file has {len(fitting)} transfer functions, from {inputs} to {outputs}"
            remedy = "name input_channel and output_channel in a [[transfer_function]]"
        else:
            problem = f"the file has no transfer function from {into} to {out}"
            known = sorted(b for a, b in pairs if a == into)
            remedy = f"outputs measured with that input: {', '.join(known[:6])}"
        raise InputError.of("output_channel" if into else "input_channel", problem, remedy)


def _listed(channels: Iterable[str]) -> str:
    """List channels, each once."""
    every = list(dict.fromkeys(channels))
    more = f" and {len(every) - LISTED} more" if len(every) > LISTED else ""
    return ", ".join(every[:LISTED]) + more


def read(path: Path) -> Dtt:
    """Read all transfer functions and coherences of a DTT file, also those that spectra give.

    Raises `InputError` if it is not XML of DTT, or a stream is cut off.
    """
    found: dict[str, dict[Pair, Trace]] = {
        kind: {} for kind in ("transfer", "cross", "coherence", "amplitude")
    }
    stored = [
        node
        for node in _root(path).iter("LIGO_LW")
        if re.fullmatch(r"(Result|Reference)\[\d+\]", node.get("Name", ""))
    ]
    if not stored:
        problem = "has no results of the diagnostics test tools"
        raise InputError.of("", problem, "save the measurement in diaggui, as XML")
    for node in stored:
        parameters = {one.get("Name", ""): (one.text or "").strip() for one in node.iter("Param")}
        kind, place = CONTENTS.get((node.get("Type", ""), parameters.get("Subtype", "")), ("", ""))
        try:
            for pair, trace in _traces(node, parameters, kind, place) if kind else ():
                found[kind].setdefault(pair, trace)
        except (KeyError, ValueError, binascii.Error) as error:
            missing = f"{error} is missing" if isinstance(error, KeyError) else error
            fault = Fault(node.get("Name", ""), f"cannot be read ({missing})", AGAIN)
            raise InputError([fault]) from None
    for (a, b), (frequency, cross, averages) in found["cross"].items():
        for pair, value in (((a, b), np.conj(cross)), ((b, a), cross)):
            density = found["amplitude"].get((pair[0], ""))
            if density is not None and len(density.value) == len(value):
                with np.errstate(divide="ignore", invalid="ignore"):
                    value = value / density.value.astype(float) ** 2
                found["transfer"].setdefault(pair, Trace(frequency, value, averages))
    densities = {channel: trace for (channel, _), trace in found["amplitude"].items()}
    return Dtt(found["transfer"], found["coherence"], densities)


def _traces(
    node: ElementTree.Element, parameters: dict[str, str], kind: str, place: str
) -> Iterator[tuple[Pair, Trace]]:
    """Read the traces of one result."""
    count = int(parameters["N"])
    traces = int(parameters.get("M", "1"))
    frequency, values = _numbers(node, count, traces, kind in ("transfer", "cross"), place)
    if frequency is None:
        frequency = float(parameters["f0"]) + np.arange(count) * float(parameters["df"])
    averages = float(parameters.get("Averages", 0)) or None
    name = node.get("Name", "")
    suffix = f"(REF{name[10:-1]})" if name.startswith("Reference") else ""
    names = [name for name in parameters if re.fullmatch(r"ChannelB(\[\d+\])?", name)]
    names.sort(key=lambda name: int(re.sub(r"\D", "", name) or 0))
    seconds = [""] if kind == "amplitude" else [parameters[name] + suffix for name in names]
    if len(seconds) < traces:
        raise ValueError(f"{traces} traces, but {len(seconds)} channels B")
    first = parameters["ChannelA"] + suffix
    for second, row in zip(seconds, values, strict=False):
        yield (first, second), Trace(frequency, row, averages)


def _numbers(
    node: ElementTree.Element, count: int, traces: int, is_complex: bool, place: str
) -> tuple[np.ndarray | None, np.ndarray]:
    """Frequencies (N,) or None, and values (M, N) of a stream."""
    stream = node.find("Array/Stream")
    if stream is None:
        raise ValueError("no Array/Stream")
    encoding = stream.get("Encoding", "LittleEndian,base64").lower()
    if "base64" not in encoding:
        raise ValueError(f"encoding {format_value(encoding)} is not base64")
    data = base64.b64decode("".join((stream.text or "").split()), validate=True)
    order = ">" if "big" in encoding else "<"
    frequency = None
    if place == "double":
        frequency = np.frombuffer(data[: 8 * count], f"{order}f8").astype(float)
        data = data[8 * count :]
    rows = traces + (place == "first")
    kinds = (f"{order}c8", f"{order}c16") if is_complex else (f"{order}f4", f"{order}f8")
    sizes = {rows * count * np.dtype(kind).itemsize: kind for kind in kinds}
    if len(data) not in sizes or len(data) == 0:
        needed = " or ".join(map(str, sizes))
        raise ValueError(f"the stream has {len(data)} bytes, {needed} are needed")
    values = np.frombuffer(data, sizes[len(data)]).reshape(rows, count)
    if place == "first":
        frequency = values[0].real.astype(float)
        values = values[1:]
    return frequency, values.astype(complex if is_complex else float)


def _root(path: Path) -> ElementTree.Element:
    kind = "a measurement that diaggui saved"
    data = whole_files.read_bytes(path, whole_files.DATA, kind)
    if data[:2] == b"\x1f\x8b":
        try:
            with gzip.open(io.BytesIO(data)) as stream:
                data = whole_files.checked_size(
                    stream.read(whole_files.DATA + 1), whole_files.DATA, kind
                )
        except (OSError, EOFError, zlib.error) as error:
            raise InputError.of("", f"is not whole gzip ({error})", AGAIN) from None
    root = _parse(data)
    if root.tag != "LIGO_LW":
        problem = f"is XML of {format_value(root.tag)}, not of the diagnostics test tools (LIGO_LW)"
        raise InputError.of("", problem, "name a file that diaggui saved, a CSV or HDF5")
    return root


def _parse(data: bytes) -> ElementTree.Element:
    """Parse XML without entities, of bounded depth and number of elements."""
    builder = ElementTree.TreeBuilder()
    parser = expat.ParserCreate()
    started = depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal started, depth
        started += 1
        depth += 1
        if started > MAX_ELEMENTS or depth > MAX_DEPTH:
            raise ValueError("too many elements")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def refuse(*_declared: object) -> None:
        raise InputError.of("", "defines XML entities", AGAIN)

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = builder.data
    parser.EntityDeclHandler = refuse
    parser.buffer_text = True
    try:
        parser.Parse(data, True)
        return builder.close()
    except (expat.ExpatError, LookupError, ValueError, AssertionError) as error:
        # of unknown and of multi-byte encodings, too
        raise InputError.of("", f"is not XML ({one_line(error)})", AGAIN) from None
