"""Modes and responses of a design beside those of another program."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from suspension_cli.drawing.panels import Across, Line, Panel
from suspension_cli.drawing.panels import draw as draw_panels
from suspension_cli.drawing.style import PALETTE, save
from tools.tables import ROOT
from tools.validation import undamped
from tools.validation.page import number_of_percent
from tools.validation.pictures import CROSS, DOT, RING, deviation_panel, with_room

MODELS = ("string", "beam")
HEAD = [
    "suspension",
    "modes",
    "string within 0.1 %",
    "median (%)",
    "worst (%)",
    "beam, worst (%)",
    "responses within 1 % (%)",
    "median (%)",
]
"""Columns of the table of all suspensions."""
MODES_HEAD = ["design", "mode", "theirs_hz", "string_hz", "string_off", "beam_hz", "beam_off"]
"""Columns of `results/validation_modes.csv`; deviations are relative."""
CLOSE = 1e-3
"""Deviation within which a mode counts as the same."""


@dataclass(frozen=True)
class Comparison:
    """Numbers of a peer, which is another program, beside ours.

    Attributes
    ----------
    title, why
        Of the suspension, and what explains the deviations.
    known, label
        Frequencies of the peer's modes that oscillate (Hz), and our names for them.
    ours
        Our frequencies by model, Hz.
    unstable
        Number of the peer's modes that do not oscillate.
    frequency, responses
        Frequencies (Hz), and the peer's and our responses by name.
    """

    name: str
    title: str
    why: str
    peer: str
    known: np.ndarray
    label: list[str]
    ours: dict[str, np.ndarray]
    unstable: int
    frequency: np.ndarray
    responses: dict[str, tuple[np.ndarray, np.ndarray]]

    def error(self, model: str) -> np.ndarray:
        """Relative deviations of our modes."""
        return self.ours[model] / self.known - 1

    @property
    def close(self) -> int:
        """Number of modes of the string model that are the same."""
        return int((abs(self.error("string")) < CLOSE).sum())

    @property
    def within(self) -> str:
        """How many modes of the string model are the same."""
        return f"{self.close} of {len(self.known)} modes within 0.1 %"

    def modes(self) -> list[list[str]]:
        """Rows of all modes, see `MODES_HEAD`."""
        return [
            [self.name, label, f"{known:.9g}"]
            + [
                cell
                for model in MODELS
                for cell in (f"{self.ours[model][n]:.9g}", f"{self.error(model)[n]:+.2e}")
            ]
            for n, (label, known) in enumerate(zip(self.label, self.known, strict=True))
        ]

    def response_error(self) -> np.ndarray:
        """Relative deviations of our responses, all in one list."""
        return np.concatenate([abs(ours / known - 1) for known, ours in self.responses.values()])


def compare(name: str, title: str, why: str, *, peer: str, folder: str) -> Comparison:
    """Compute the modes and responses of a design in `configs/built/`.

    The numbers of the peer are in `measured/`, in a folder and a file named like the design.
    """
    document = tomllib.loads((ROOT / "measured" / folder / f"{name}.toml").read_text("utf-8"))
    design = undamped.parse((ROOT / "configs" / "built" / f"{name}.toml").read_text("utf-8"))
    whole = np.array(document["modes"]["frequency_hz"])
    known, ours, labels = whole[whole > 1e-3], {}, {}
    for model in MODELS:
        found, names = undamped.frequencies(undamped.system(design, model))
        chosen = undamped.pair(known, found)
        ours[model], labels[model] = found[chosen], [names[n] for n in chosen]
    rows: dict[str, Any] = document["responses"]
    frequency = np.array(rows.pop("frequency_hz"))
    pairs = [(key.split(" / ")[1], key.split(" / ")[0]) for key in rows]
    values = undamped.respond(undamped.system(design, "string"), pairs, frequency)
    responses = {
        key: (np.array(rows[key]), value.real) for key, value in zip(rows, values, strict=True)
    }
    slow = int((whole <= 1e-3).sum())
    numbers = known, labels["string"], ours, slow, frequency, responses
    return Comparison(name, title, why, peer, *numbers)


def row(one: Comparison) -> list[str]:
    """Row of the table of all suspensions, see `HEAD`."""
    error, beam, response = one.error("string"), one.error("beam"), one.response_error()
    cells = [one.title, str(len(error)), str(one.close)]
    cells.append(f"{100 * np.median(abs(error)):.1g}")
    for part in (error, beam):
        n = int(np.argmax(abs(part)))
        cells.append(f"{number_of_percent(part[n])} ({one.label[n]})")
    share = (response < 1e-2).mean()
    return [*cells, f"{100 * share:.0f}", f"{100 * np.median(response):.1g}"]


def details(one: Comparison, shown: tuple[str, ...]) -> list[str]:
    """Lines on one suspension, with its picture."""
    picture = f"validation_{one.name.replace('-', '_')}.png"
    save(draw(one, shown), ROOT / "results" / picture)
    extra = f" {one.peer} has {one.unstable} modes more, below 1 mHz or unstable."
    why = one.why + (extra if one.unstable else "")
    lines = ["", f"**{one.title}**, `configs/built/{one.name}.toml`: {why}"]
    lines += ["", f"![{one.title}]({picture})", ""]
    return lines


SMALLEST = 1e-3
"""Deviation in % below which the axes of the picture are linear."""
LIMITS = (-200.0, 2000.0)
"""Of the axes of deviations, %."""


def draw(one: Comparison, shown: tuple[str, ...]) -> Figure:
    """Draw responses, and the deviations of modes and responses with their sign."""
    modes = [
        Line(one.known, 100 * one.error(model), model, colour, look)
        for model, colour, look in zip(MODELS, PALETTE, (DOT, CROSS), strict=False)
    ]
    responses: list[Line] = []
    deviations: list[Line] = []
    names = [name for name in shown if name in one.responses]
    for name, colour in zip(names, PALETTE, strict=False):
        known, ours = one.responses[name]
        responses.append(Line(one.frequency, abs(ours), name, colour))
        responses.append(Line(one.frequency, abs(known), "_", colour, RING))
        deviations.append(Line(one.frequency, 100 * (ours / known - 1), "_", colour, DOT))
    share = (one.response_error() < 1e-2).mean()
    remark = f"{len(one.responses)} responses: {100 * share:.0f} % of all values within 1 %"
    modes_axis = Across("frequency of the mode (Hz)", limits=with_room(one.known))
    axis = Across(limits=with_room(one.frequency))
    panels = [
        deviation_panel(modes, LIMITS, SMALLEST, modes_axis, 100 * CLOSE),
        Panel(
            "response (SI units)",
            responses,
            1.9,
            "log",
            remarks=[f"lines: string model, circles: {one.peer}"],
        ),
        deviation_panel(deviations, LIMITS, SMALLEST, axis, 1.0, remarks=[remark]),
    ]
    count = f"{one.close} of {len(one.known)}"
    heading = f"{count} modes are within 0.1 % of {one.peer}'s"
    return draw_panels(heading, f"{one.title}; grey: within 0.1 %, responses within 1 %", panels)
