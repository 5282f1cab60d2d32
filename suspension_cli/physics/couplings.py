"""Cross-coupling: the ratio of two motions for one input (Husman et al. 2000, section 6)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.design.faults import suggest
from suspension_cli.errors import InputError, format_value
from suspension_cli.grids import parse_frequencies
from suspension_cli.linear import signals
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.system import LinearSystem
from suspension_cli.studies import builds
from suspension_cli.studies.builds import Builds
from suspension_cli.studies.run import Columns

ROUNDING = 1e-17
"""Ratio below which rounding dominates: rounded coordinates of attachments couple some 1e-19."""


@dataclass(frozen=True)
class CouplingRequest:
    """Cross-coupling to compute for every build: `over` by `under` for an `input`, at Hz.

    The imperfect wire is numbered from 0 (-1: none), the imperfect body from 1; `hold` is what is
    kept when the wire changes.
    """

    wire: int
    body: int
    hold: str
    input: Signal
    over: Signal
    under: Signal
    frequency: tuple[float, ...]


def parse_request(model: LinearSystem, setting: Mapping[str, Any], mirror: str) -> CouplingRequest:
    """Interpret the options of a cross-coupling: imperfect wire and body, signals, frequencies.

    Any `model` of the design knows the names of wires and bodies; `mirror` is the default body.
    """
    known = signals.bodies_with_signals(model)
    labels = list(model.wire)
    wire = setting.get("wire") or next(
        (label for label in labels if label.startswith(f"{mirror}.")), None
    )
    if wire is not None and wire not in labels:
        raise InputError.of("--wire", "names no wire", suggest(wire, labels), format_value(wire))
    body = setting.get("body") or (mirror if wire is None else wire.rsplit(".", 1)[0])
    if body not in model.body:
        close = suggest(body, list(model.body))
        raise InputError.of("--body", "names no stage", close, format_value(body))
    observed, _, point = (setting["observe"] or f"{mirror}@0,0,-0.001").partition("@")
    at = f"@{point}" if point else ""
    over, under = (name if setting[name[2:]] else "--observe" for name in ("--over", "--under"))
    return CouplingRequest(
        wire=-1 if wire is None else labels.index(wire),
        body=model.body.index(body) + 1,
        hold=setting.get("hold", ""),
        input=signals.parse_input(setting["input"], known),
        over=signals.parse_output(setting["over"] or f"{observed}.x{at}", known, over),
        under=signals.parse_output(setting["under"] or f"{observed}.z{at}", known, under),
        frequency=tuple(parse_frequencies(setting["frequency"])),
    )


def couplings(found: Builds, question: CouplingRequest) -> Columns:
    """Compute the coupling, and both motions per input, of balanced builds, and their status."""
    outputs = builds.transfer(
        found, np.array(question.frequency), [question.input], [question.over, question.under]
    )[..., 0]
    over = outputs[..., 0]
    under = outputs[..., 1]
    return {"ratio": builds.divide(over, under), "over": over, "under": under, **found.outcome}
