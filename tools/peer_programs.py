"""Times of this program and of others for the same work: python-control, pygwinc, plain loops.

Writes `results/tradeoff_peers.png` and the table `tradeoff_peers.md`. Run by `make tradeoff`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import control
import gwinc
import numpy as np
from gwinc.suspension import suspQuad
from matplotlib.figure import Figure

from suspension_cli.analyses.tradeoff.measure import format_time, median_times
from suspension_cli.design.derive import mirror
from suspension_cli.design.reader import read
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PALETTE,
    add_axes,
    house_style,
    new_figure,
    save,
    write_heading,
)
from suspension_cli.files.whole_files import write_bytes
from suspension_cli.linear import response, signals, statespace
from suspension_cli.models import registry
from suspension_cli.physics import thermal_noise
from tests.support.paths import ROOT

FREQUENCY = np.geomspace(0.1, 100.0, 1000)
"""Hz."""
OURS = "pendsus"
ROW = 0.3
"""Height of a bar with its gap, in."""


@dataclass(frozen=True)
class Peer:
    """A program that does a piece of work: its processor time, s.

    `difference` is the largest one of its result from that of pendsus, relative; None where it
    models something else.
    """

    program: str
    time: float
    difference: float | None


def measure_response() -> list[Peer]:
    """Measure the response of the mirror to the support, in the force model of the quadruple."""
    design = read(ROOT / "configs" / "quadruple.toml").design
    model = registry.FORCE.system(design)
    known = signals.bodies_with_signals(model)
    into = [signals.parse_input("support.x", known)]
    out = [signals.parse_output(f"{mirror(design)}.x", known)]
    omega = 2 * np.pi * FREQUENCY
    space = statespace.build(model, into, out)
    system = control.ss(space.a, space.b, space.c, space.d)
    frequency_response: Any = control.frequency_response  # its type allows for several systems
    moving = model.coordinate.index(f"{mirror(design)}.x") - 6

    def one_by_one() -> np.ndarray:
        found = []
        for one in omega:
            dynamic = model.stiffness[6:, 6:] - one**2 * model.mass[6:, 6:]
            found.append(np.linalg.solve(dynamic, -model.stiffness[6:, 0])[moving])
        return np.array(found)

    return _compare(
        {
            OURS: lambda: response.solve(model, FREQUENCY, into, out).value[:, 0, 0],
            "python-control, its state space": lambda: frequency_response(system, omega).complex,
            "loop over frequencies, dense solve": one_by_one,
        }
    )


def measure_noise() -> list[Peer]:
    """Measure thermal noise of quadruples: pygwinc has one dimension and the vertical one."""
    design = read(ROOT / "configs" / "quadruple.toml").design
    model = registry.VIOLIN.system(design)
    motions = [thermal_noise.parse_motion(model, f"{mirror(design)}.{dof}") for dof in "xz"]
    theirs = gwinc.load_budget("aLIGO").ifo.Suspension
    temperature = design.constants.temperature
    works: dict[str, Callable[[], Any]] = {
        f"{OURS}, six dimensions": lambda: thermal_noise.solve(
            model, FREQUENCY, motions, temperature
        ),
        "pygwinc, one dimension each": lambda: suspQuad(FREQUENCY, theirs),
    }
    times = median_times(list(works.values()))
    return [Peer(name, time, None) for name, time in zip(works, times, strict=True)]


def _compare(works: dict[str, Callable[[], np.ndarray]]) -> list[Peer]:
    """Measure works of one result, and their differences from the first."""
    results = [np.ravel(work()) for work in works.values()]
    first = results[0]
    apart = [float((np.abs(one - first) / np.abs(first)).max()) for one in results]
    times = median_times(list(works.values()))
    return [Peer(*row) for row in zip(works, times, apart, strict=True)]


def draw(found: dict[str, list[Peer]]) -> Figure:
    """Draw a bar for each program, in groups of one work."""
    with house_style():
        count = sum(map(len, found.values())) + len(found)
        figure = new_figure(6.0, 1.0 + ROW * count)
        write_heading(figure, "The same work by other programs", "Processor time on one core.")
        axes = add_axes(figure, 2.6, 0.5, 2.6, ROW * count)
        axes.set(xscale="log", xlabel="processor time (s)", ylim=(count - 0.5, -0.5), yticks=[])
        longest = max(peer.time for peers in found.values() for peer in peers)
        axes.set_xlim(1e-3, 3 * longest)
        axes.spines["left"].set_visible(False)  # it would cross the headings
        beside: dict[str, Any] = {"textcoords": "offset points", "va": "center", "size": 8}
        place = 0
        for title, peers in found.items():
            left = {"xycoords": ("figure fraction", "data"), **beside}
            axes.annotate(title, (0, place), (8, 0), weight="bold", color=INK, **left)
            for peer in peers:
                place += 1
                colour = PALETTE[0] if peer.program.startswith(OURS) else NOTE
                axes.barh(place, peer.time, 0.6, color=colour)
                axes.annotate(peer.program, (0, place), (8, 0), color=INK, **left)
                text = format_time(peer.time)
                axes.annotate(text, (peer.time, place), (4, 0), color=INK, **beside)
            place += 1
    return figure


def document(found: dict[str, list[Peer]]) -> str:
    """Format the page."""
    lines = [
        "# The same work by other programs",
        "",
        "Made by `make tradeoff`, on one core; times are processor times.",
        "",
        "![Processor times of pendsus and of other programs](tradeoff_peers.png)",
    ]
    for title, peers in found.items():
        lines += [
            "",
            f"## {title}",
            "",
            "| program | time | over that of pendsus | largest difference |",
            "|---|---|---|---|",
        ]
        for peer in peers:
            apart = "another design" if peer.difference is None else f"{peer.difference:.0e}"
            apart = "–" if peer.program.startswith(OURS) else apart
            ratio = peer.time / peers[0].time
            lines.append(f"| {peer.program} | {format_time(peer.time)} | {ratio:.2g} | {apart} |")
    lines += [
        "",
        "The responses are of one model (`force`) and one motion. pygwinc computes a quadruple as a"
        " chain of springs along the beam, and another one vertically; pendsus has all six motions"
        " of each body, with continuous wires (`violin`).",
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure and draw all."""
    found = {
        f"Response of a quadruple, {len(FREQUENCY):,} frequencies": measure_response(),
        f"Thermal noise of a quadruple, {len(FREQUENCY):,} frequencies": measure_noise(),
    }
    folder = ROOT / "results"
    save(draw(found), folder / "tradeoff_peers.png")
    write_bytes(folder / "tradeoff_peers.md", document(found).encode())


if __name__ == "__main__":
    main()
