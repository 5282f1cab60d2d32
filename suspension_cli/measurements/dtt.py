"""Transfer functions in XML files of the LIGO diagnostics test tools (diaggui).

A file is a LIGO_LW document. Each ``<LIGO_LW Name="Result[n]">`` (a stored trace: ``Reference[n]``)
has parameters `Subtype`, `f0`, `df`, `N` (frequencies), `M` (traces), `Averages`, `ChannelA` and
``ChannelB[m]``, and one base64 stream of single-precision numbers:

======================  =======  ==============================================================
type                    subtype  stream
======================  =======  ==============================================================
TransferFunction        0        M x N complex: B/A at f0 + n df
(swept sine)            3        N frequencies (complex), then M x N complex: B/A
                        6        N frequencies (double), then M x N complex: B/A
                        2        M x N: coherence of B and A
                        5, 7     N frequencies (single, double), then M x N: coherence
Spectrum                1, 5     amplitude spectral density of A (not its square)
(Fourier tools)         2, 6     M x N complex: cross spectrum of A and conj(B)
                        3, 7     M x N: coherence of A and B
======================  =======  ==============================================================

Spectra of subtype 4 or more begin with their frequencies. From spectra B/A is conj(P_AB)/ASD_A^2.
"""

from __future__ import annotations

import base64
import binascii
import gzip
import io
import re
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np

from suspension_cli.errors import Fault, InputError, format_value, one_line, suggest
from suspension_cli.files import bounded
from suspension_cli.files.columns import Columns

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

AGAIN = "save the measurement in diaggui again"
"""Remedy for a damaged file."""
MAX_ELEMENTS, MAX_DEPTH = 1_000_000, 50
"""Of an XML file; that of a large measurement has thousands, six deep."""
Pair = tuple[str, str]
"""Channels (input, output)."""
Trace = tuple[np.ndarray, np.ndarray, float | None]
"""Frequencies, values and the number of averages."""
_CONTENTS = {
    "TransferFunction": dict.fromkeys((0, 3, 6), "transfer")
    | dict.fromkeys((2, 5, 7), "coherence"),
    "Spectrum": dict.fromkeys((1, 5), "amplitude")
    | dict.fromkeys((2, 6), "cross")
    | dict.fromkeys((3, 7), "coherence"),
}
"""Content of results by type and subtype; from subtype 3 or 4 on their frequencies come first."""


@dataclass(frozen=True)
class Dtt:
    """Results of one DTT file, by channels (A, B).

    Attributes
    ----------
    transfer, cross, coherence, amplitude
        (frequency, values, averages); `amplitude` by channel.
    """

    transfer: dict[Pair, Trace] = field(default_factory=dict)
    cross: dict[Pair, Trace] = field(default_factory=dict)
    coherence: dict[Pair, Trace] = field(default_factory=dict)
    amplitude: dict[Pair, Trace] = field(default_factory=dict)

    @property
    def pairs(self) -> list[Pair]:
        """Channels (input, output) with a transfer function in the file."""
        both = [
            pair
            for a, b in self.cross
            for pair, base in (((a, b), a), ((b, a), b))
            if (base, "") in self.amplitude
        ]
        return list(dict.fromkeys([*self.transfer, *both]))

    def columns(self, into: str | None, out: str | None) -> Columns:
        """Return the transfer function between two channels, and its coherence.

        Parameters
        ----------
        into, out
            Names of the channels; None if the other (or the file) determines it.

        Raises
        ------
        InputError
            If there is none, with the channels of the file.
        """
        pair = self._pair(into, out)
        found = self.transfer.get(pair) or self._from_spectra(pair)
        frequency, value, averages = found
        held = {"frequency": frequency, "value": value}
        coherence = self.coherence.get(pair) or self.coherence.get((pair[1], pair[0]))
        if coherence is not None and len(coherence[1]) == len(frequency):
            held["coherence"] = coherence[1]
        # an aborted sweep ends in frequencies of 0, and a spectrum says nothing there
        order = np.argsort(frequency, kind="stable")
        order = order[frequency[order] > 0]
        kept = [values[order] for values in held.values()]
        place = lambda n: f"point {order[n] + 1} of {pair[1]}/{pair[0]}"  # noqa: E731
        return Columns([*held], kept.__getitem__, place, noun="trace", averages=averages)

    def _from_spectra(self, pair: Pair) -> Trace:
        into, out = pair
        if pair in self.cross:
            frequency, cross, averages = self.cross[pair]
            cross = np.conj(cross)
        else:
            frequency, cross, averages = self.cross[out, into]
        density = np.asarray(self.amplitude[into, ""][1], dtype=float)
        if len(density) != len(cross):
            problem = f"spectra of {into} and of {out} have {len(density)} and {len(cross)} points"
            raise InputError.of("", problem, "export them from one measurement")
        with np.errstate(divide="ignore", invalid="ignore"):
            return frequency, cross / density**2, averages

    def _pair(self, into: str | None, out: str | None) -> Pair:
        pairs = self.pairs
        if not pairs:
            problem = "has no transfer function and no cross spectra with their power spectra"
            raise InputError.of("", problem, "measure a transfer function, or export it")
        for n, (key, name) in enumerate((("input_channel", into), ("output_channel", out))):
            known = sorted({pair[n] for pair in pairs})
            if name is not None and name not in known:
                role = ("input", "output")[n]
                problem = f"is the {role} of no transfer function in the file"
                raise InputError.of(key, problem, suggest(name, known), format_value(name))
        fitting = [
            pair for pair in pairs if (into or pair[0]) == pair[0] and (out or pair[1]) == pair[1]
        ]
        if len(fitting) == 1:
            return fitting[0]
        if fitting:
            some = "; ".join(f"{a} to {b}" for a, b in fitting[:4])
            problem = f"the file has {len(fitting)} transfer functions ({some}, ...)"
            remedy = "name input_channel and output_channel in a [[transfer_function]]"
        else:
            problem = f"the file has no transfer function from {into} to {out}"
            known = sorted(b for a, b in pairs if a == into)
            remedy = f"outputs measured with that input: {', '.join(known[:6])}"
        raise InputError.of("output_channel" if into else "input_channel", problem, remedy)


def read(path: Path) -> Dtt:
    """Read all transfer functions, cross spectra and coherences of a DTT file.

    Raises `InputError` if it is not XML of DTT, or a stream is cut off.
    """
    root = _root(path)
    found = Dtt()
    stored = [
        node
        for node in root.iter("LIGO_LW")
        if re.fullmatch(r"(Result|Reference)\[\d+\]", node.get("Name", ""))
    ]
    if not stored:
        problem = "has no results of the diagnostics test tools"
        raise InputError.of("", problem, "save the measurement in diaggui, as XML")
    for node in stored:
        parameters = {one.get("Name", ""): (one.text or "").strip() for one in node.iter("Param")}
        try:
            kind, subtype = node.get("Type", ""), int(parameters.get("Subtype", ""))
            if content := _CONTENTS.get(kind, {}).get(subtype):
                own_frequencies = subtype > (2 if kind == "TransferFunction" else 3)
                _add(found, node, parameters, content, own_frequencies)
        except (KeyError, ValueError, binascii.Error) as error:
            problem = f"cannot be read ({_reason(error)})"
            fault = Fault(node.get("Name", ""), problem, AGAIN)
            raise InputError([fault]) from None
    return found


def _add(
    found: Dtt,
    node: ElementTree.Element,
    parameters: Mapping[str, str],
    kind: str,
    own_frequencies: bool,
) -> None:
    count, traces = int(parameters["N"]), int(parameters.get("M", "1"))
    complex_values = kind in ("transfer", "cross")
    frequency, values = _numbers(node, count, traces, own_frequencies, complex_values)
    if frequency is None:
        frequency = float(parameters["f0"]) + np.arange(count) * float(parameters["df"])
    first, averages = parameters["ChannelA"], float(parameters.get("Averages", 0)) or None
    is_reference = node.get("Name", "").startswith("Reference")
    suffix = f"(REF{node.get('Name', '')[10:-1]})" if is_reference else ""
    seconds = [
        parameters[name]
        for name in sorted(
            (name for name in parameters if re.fullmatch(r"ChannelB(\[\d+\])?", name)),
            key=lambda name: int(re.sub(r"\D", "", name) or 0),
        )
    ]
    if kind == "amplitude":
        seconds = [""]
    if len(seconds) < traces:
        raise ValueError(f"{traces} traces, but {len(seconds)} channels B")
    for second, row in zip(seconds, values, strict=False):
        pair = (first + suffix, second + suffix if second else "")
        getattr(found, kind).setdefault(pair, (frequency, row, averages))


def _numbers(
    node: ElementTree.Element,
    count: int,
    traces: int,
    own_frequencies: bool,
    complex_values: bool,
) -> tuple[Float[np.ndarray, " frequency"] | None, Inexact[np.ndarray, "trace frequency"]]:
    """Frequencies (N,) or None, and values (M, N) of a stream."""
    stream = node.find("Array/Stream")
    if stream is None:
        raise ValueError("no Array/Stream")
    encoding = stream.get("Encoding", "LittleEndian,base64").lower()
    if "base64" not in encoding:
        raise ValueError(f"encoding {format_value(encoding)} is not base64")
    data = base64.b64decode("".join((stream.text or "").split()), validate=True)
    order = ">" if "big" in encoding else "<"
    single, double = (
        (f"{order}c8", f"{order}c16") if complex_values else (f"{order}f4", f"{order}f8")
    )
    frequency: Float[np.ndarray, " frequency"] | None = None
    number = int(node.findtext("Param[@Name='Subtype']") or 0)
    if own_frequencies and node.get("Type") == "TransferFunction" and number in (6, 7):
        frequency = np.frombuffer(data[: 8 * count], f"{order}f8")
        data = data[8 * count :]
        rows = traces
    else:
        rows = traces + own_frequencies
    sizes = {rows * count * np.dtype(kind).itemsize: kind for kind in (single, double)}
    if len(data) not in sizes or len(data) == 0:
        needed = " or ".join(map(str, sizes))
        raise ValueError(f"the stream has {len(data)} bytes, {needed} are needed")
    values = np.frombuffer(data, sizes[len(data)]).reshape(rows, count)
    if own_frequencies and frequency is None:
        frequency, values = values[0].real, values[1:]
    wide = complex if complex_values else float
    return None if frequency is None else frequency.astype(float), values.astype(wide)


def _root(path: Path) -> ElementTree.Element:
    kind = "a measurement that diaggui saved"
    data = bounded.read_bytes(path, bounded.DATA, kind)
    if data[:2] == b"\x1f\x8b":
        try:
            with gzip.open(io.BytesIO(data)) as stream:
                data = stream.read(bounded.DATA + 1)
        except (OSError, EOFError, zlib.error) as error:
            raise InputError.of("", f"is not whole gzip ({error})", AGAIN) from None
        bounded.checked_size(data, bounded.DATA, kind)
    root = _parse(data)
    if root.tag != "LIGO_LW":
        problem = f"is XML of {format_value(root.tag)}, not of the diagnostics test tools (LIGO_LW)"
        raise InputError.of("", problem, "name a file that diaggui saved, a CSV or HDF5")
    return root


def _parse(data: bytes) -> ElementTree.Element:
    """Parse XML without entities, of bounded depth and number of elements."""
    builder, parser = ElementTree.TreeBuilder(), expat.ParserCreate()
    started = depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal started, depth
        started, depth = started + 1, depth + 1
        if started > MAX_ELEMENTS or depth > MAX_DEPTH:
            raise ValueError("too many elements")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def refuse(*_declared: object) -> None:
        raise InputError.of("", "defines XML entities", AGAIN)

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler, parser.EntityDeclHandler = builder.data, refuse
    parser.buffer_text = True
    try:
        parser.Parse(data, True)
        return builder.close()
    except (expat.ExpatError, LookupError, ValueError, AssertionError) as error:
        # of unknown and of multi-byte encodings, too
        raise InputError.of("", f"is not XML ({one_line(error)})", AGAIN) from None


def _reason(error: Exception) -> str:
    return f"{error} is missing" if isinstance(error, KeyError) else str(error)
