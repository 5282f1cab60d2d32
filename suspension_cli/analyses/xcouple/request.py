"""Options of a cross-coupling as a `CouplingRequest`."""

from __future__ import annotations

from suspension_cli.analyses.analysis import Settings
from suspension_cli.analyses.xcouple.solve import CouplingRequest
from suspension_cli.design.faults import suggest
from suspension_cli.errors import InputError, format_value
from suspension_cli.grids import parse_frequencies
from suspension_cli.linear import signals
from suspension_cli.linear.system import LinearSystem


def parse_request(model: LinearSystem, setting: Settings, mirror: str) -> CouplingRequest:
    """Interpret the options of a cross-coupling: imperfect wire and body, signals, frequencies.

    Any `model` of the design knows the names of wires and bodies; `mirror` is the default body.

    Raises `InputError` if an option names no wire, stage or signal.
    """
    known, labels = signals.bodies_with_signals(model), list(model.wire)
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
