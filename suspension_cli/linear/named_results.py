"""Scalar results of a design by name: mode frequencies and response magnitudes.

- ``test pitch``: frequency of the mode that is mostly that motion, in each design (`mode_content`);
  ``test pitch#2``: of the second mode with that label in `pendsus modes`
- ``5``: frequency of mode number 5 of the design as drawn, followed by its shape to other designs;
  ``modes``: of all modes, followed likewise
- ``test.x@0,0,0.001/support.x:10``: magnitude of a response at 10 Hz
- ``test.x/test.z/support.z:50``: magnitude of the ratio of two responses to one input (a coupling)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from suspension_cli.design.faults import suggest
from suspension_cli.errors import InputError, format_value
from suspension_cli.grids import parse_place
from suspension_cli.linear import eigenmodes, mode_content, signals
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.mode_content import Motion
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.system import LinearSystem

ALL = "modes"
"""Name that stands for all modes."""


@dataclass(frozen=True)
class Mode:
    """Frequency of one mode: its label, numbered if several have it, and its position, from 0.

    In another design it is the mode that is mostly this `motion`, or if that is None the one that
    follows from it by its shape.
    """

    text: str
    number: int
    motion: Motion | None = None

    @property
    def unit(self) -> str:
        """Unit of the frequency."""
        return "Hz"


@dataclass(frozen=True)
class Ratio:
    """Magnitude of a response, or of the ratio of two outputs, at one frequency (Hz)."""

    text: str
    over: Signal
    under: Signal | None
    input: Signal
    frequency: float

    @property
    def unit(self) -> str:
        """Unit of the ratio."""
        return quotient_unit(self.over, self.under or self.input)


def quotient_unit(over: Signal, under: Signal) -> str:
    """Unit of the ratio of two signals, ``m/(N m)``."""
    same = over.unit == under.unit
    return "1" if same else f"{over.unit}/{under.unit}".replace("/N m", "/(N m)")


Scalar = Mode | Ratio


def labels(modes: Modes) -> list[str]:
    """Distinct names of the modes (`Modes.numbered_label`)."""
    return modes.numbered_label


def of_system(texts: Sequence[str], system: LinearSystem) -> tuple[Scalar, ...]:
    """Parse the names of results of a linear system; all modes if there are none."""
    modes, known = eigenmodes.solve(system.constant), signals.bodies_with_signals(system)
    return parse(list(texts) or [ALL], modes, known)


def parse(
    texts: list[str], modes: Modes, known: tuple[str, ...], option: str = "--result"
) -> tuple[Scalar, ...]:
    """Parse the names of scalar results of the design as drawn, whose modes are given.

    `known` are the `signals.bodies_with_signals`, or empty if only modes are allowed.
    """
    found: list[Scalar] = []
    for text in texts:
        if "/" in text and known:
            found.append(_ratio(text, known, option))
        else:
            found += _modes(text.strip(), modes, option, only=not known)
    by_label = [one.text for one in found if isinstance(one, Mode) and one.motion]
    distinct = [
        replace(one, text=f"{one.text} (mode {one.number + 1})")
        if isinstance(one, Mode) and one.motion is None and one.text in by_label
        else one
        for one in found
    ]
    return tuple(dict.fromkeys(distinct))


def _modes(text: str, modes: Modes, option: str, *, only: bool = False) -> list[Mode]:
    """Select modes by label or number; `only` if responses are not allowed."""
    names = labels(modes)
    every = [Mode(name, n) for n, name in enumerate(names)]
    if text == ALL:
        return every
    place = parse_place(text, len(every))
    if place is not None:
        return [every[place]]
    pairs = zip(every, modes.label, strict=True)
    chosen = [mode for mode, label in pairs if text in (mode.text, label)]
    if len(chosen) == 1 or (chosen and "#" in text):
        return [replace(mode, motion=_motion(mode, modes)) for mode in chosen]
    problem, remedy = "is the label of no mode", suggest(text, names)
    if chosen:
        problem = f"is the label of {len(chosen)} modes"
        remedy = (
            f"write {chosen[0].text!r} to {chosen[-1].text!r}, or its number in pendsus modes on"
            " the same model"
        )
    elif not only:
        remedy += "; a response is OUTPUT/INPUT:FREQUENCY, a coupling OVER/UNDER/INPUT:FREQUENCY"
    raise InputError.of(option, problem, remedy, format_value(text))


def shared_motions(results: Sequence[Scalar], modes: Modes) -> list[str]:
    """Say which modes, asked for by their labels, share their motion with another mode."""
    motions = [
        (one.text, one.motion)
        for one in results
        if isinstance(one, Mode) and one.motion is not None
    ]
    said = [
        mode_content.describe_shared(text, motion, modes.fractions, modes.frequency)
        for text, motion in motions
    ]
    return [line for line in said if line]


def _motion(mode: Mode, modes: Modes) -> Motion:
    """Motion that the label of a mode names."""
    place = int(mode_content.leading(modes.fractions)[mode.number])
    label = modes.label[mode.number]
    alone = modes.label.count(label) == 1
    return Motion(place, 0 if alone else modes.label[: mode.number + 1].count(label))


def _ratio(text: str, known: tuple[str, ...], option: str) -> Ratio:
    names, colon, at = text.partition(":")
    parts, problem, remedy = [part.strip() for part in names.split("/")], "", ""
    try:
        frequency = float(at)
    except ValueError:
        frequency = math.nan
    if not colon or not 0 <= frequency < 1e9 or len(parts) not in (2, 3):
        remedy = (
            "write OUTPUT/INPUT:FREQUENCY or OVER/UNDER/INPUT:FREQUENCY, in Hz: test.x/support.x:10"
        )
        raise InputError.of(option, "is no response", remedy, format_value(text))
    *motions, drive = (signals.parse(part, option, known) for part in parts)
    if wrong := [signal for signal in motions if signal.acts]:
        problem, remedy = f"{wrong[0].text} is an input", "divide a motion by it"
    elif not signals.is_input(drive):
        problem = f"{drive.text} is an output"
        remedy = f"end with support.x, or a force such as {drive.body}.{signals.FORCES[drive.dof]}"
    if problem:
        raise InputError.of(option, problem, remedy, format_value(text))
    label = "/".join(parts) + f":{frequency:g}"
    return Ratio(label, motions[0], motions[1] if len(motions) > 1 else None, drive, frequency)
