"""Single numbers that a design can be asked for, by name.

``test pitch``                               a mode's frequency, under its label in `pendsus modes`; ``test pitch#2`` is the second of that label
``5``                                        the mode of that number
``test.x@0,0,0.001/support.x:10``            size of a response at a frequency in Hz
``test.x/test.z/support.z:50``               size of the ratio of two responses to one input: a coupling
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from suspension_cli.analysis import signals
from suspension_cli.analysis.modes import Modes
from suspension_cli.analysis.signals import Signal
from suspension_cli.design.faults import suggestion
from suspension_cli.errors import Fault, InputError, shown

ALL = "modes"
"""Stands for every mode."""


@dataclass(frozen=True)
class Mode:
    """The frequency of one mode.

    Attributes
    ----------
    text : str
        Its label, with a number where several modes share it.
    number : int
        Its place among the modes of the design as drawn, from 0.
    """

    text: str
    number: int

    @property
    def unit(self) -> str:
        """Unit."""
        return "Hz"


@dataclass(frozen=True)
class Ratio:
    """Size of a response, or of the ratio of two, at one frequency.

    Attributes
    ----------
    text : str
    over : Signal
        An output.
    under : Signal or None
        Another output, for the ratio of the two.
    input : Signal
    frequency : float
        Hz.
    """

    text: str
    over: Signal
    under: Signal | None
    input: Signal
    frequency: float

    @property
    def unit(self) -> str:
        """Unit."""
        below = self.under or self.input
        return "1" if self.over.unit == below.unit else f"{self.over.unit}/{below.unit}".replace("/N m", "/(N m)")


Scalar = Mode | Ratio


def labels(modes: Modes) -> list[str]:
    """A name of its own for every mode: its label, numbered in ascending order of frequency where several have the same."""
    plain = modes.label
    return [label if plain.count(label) == 1 else f"{label}#{plain[: n + 1].count(label)}" for n, label in enumerate(plain)]


def parse(texts: list[str], modes: Modes, known: tuple[str, ...], option: str = "--result") -> tuple[Scalar, ...]:
    """The numbers that names stand for.

    Parameters
    ----------
    texts : list of str
    modes : Modes
        Of the design as drawn.
    known : tuple of str
        Bodies, see `signals.bodies`; empty where nothing but modes can be meant.
    option : str
        For faults.
    """
    found: list[Scalar] = []
    for text in texts:
        found += [_ratio(text, known, option)] if "/" in text and known else _modes(text.strip(), modes, option, only=not known)
    return tuple(dict.fromkeys(found))


def _modes(text: str, modes: Modes, option: str, *, only: bool = False) -> list[Mode]:
    """Modes by a label or number; `only` where nothing but modes can be meant."""
    names = labels(modes)
    every = [Mode(name, n) for n, name in enumerate(names)]
    if text == ALL:
        return every
    if text.isascii() and text.isdigit() and 1 <= int(text) <= len(every):
        return [every[int(text) - 1]]
    chosen = [mode for mode, label in zip(every, modes.label, strict=True) if text in (mode.text, label)]
    if len(chosen) > 1 and "#" not in text:
        remedy = f"write {chosen[0].text!r} to {chosen[-1].text!r}, or its number in pendsus modes on the same rung"
        raise InputError([Fault(option, f"is the label of {len(chosen)} modes", remedy, shown(text))])
    if not chosen:
        remedy = suggestion(text, names) + ("" if only else "; a response is OUTPUT/INPUT:FREQUENCY, a coupling OVER/UNDER/INPUT:FREQUENCY")
        raise InputError([Fault(option, "is the label of no mode", remedy, shown(text))])
    return chosen


def _ratio(text: str, known: tuple[str, ...], option: str) -> Ratio:
    names, colon, at = text.partition(":")
    parts = [part.strip() for part in names.split("/")]
    try:
        frequency = float(at)
    except ValueError:
        frequency = math.nan
    if not colon or not 0 <= frequency < 1e9 or len(parts) not in (2, 3):
        remedy = "write OUTPUT/INPUT:FREQUENCY or OVER/UNDER/INPUT:FREQUENCY, in Hz: test.x/support.x:10"
        raise InputError([Fault(option, "is no response", remedy, shown(text))])
    found = [signals.parse(part, option, known) for part in parts]
    for signal in found[:-1]:
        if signal.acts:
            raise InputError([Fault(option, f"{signal.text} is an input", "divide a motion by it", shown(text))])
    drive = found[-1]
    if not drive.acts and drive.body != "support":
        remedy = f"end with support.x, or a force such as {drive.body}.{signals.FORCES[drive.dof]}"
        raise InputError([Fault(option, f"{drive.text} is an output", remedy, shown(text))])
    return Ratio("/".join(parts) + f":{frequency:g}", found[0], found[1] if len(found) == 3 else None, drive, frequency)
