"""Survey of simple filters in loops of a single pendulum: `python -m tools.loops [REPEAT]`.

Each design command of Foton, continuous and at several sample rates, closes a loop of one pendulum
in yaw or in x (which moves pitch, too). `damp`, `modes`, `response --closed-loop` and `export` have
to run, or to refuse in one line. The poles of `damp` are compared with the roots s of

    a(s) d(z) + b(s) n(z),    z = exp(s / rate),

with the plant b / a of the state space and n / d from coefficients, and the argument principle
counts those with abs(Im s) below half the rate. With the delay of half a sample and at the lowest
rate they are also compared with the sampled system. Exits with 1 for a fault.
"""

from __future__ import annotations

import sys
import tomllib
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import tomli_w
from scipy import signal

import suspension_cli as sus
from suspension_cli.conventions import DOFS
from suspension_cli.design.control import make_response
from suspension_cli.linear import signals, statespace
from suspension_cli.models import registry

Roots = Any
RATES = (0.0, 64.0, 2048.0, 16384.0)
"""Sample rates, Hz; 0 of a continuous filter."""
DEPTH = 3.0
"""Decay per sample, nepers, up to which roots are counted."""
BESIDE = 0.98
"""Fraction of half the rate up to which roots are counted."""
CLOSE = 1e-6
"""Largest relative distance of a pole from its root."""
SAMPLED = 64.0, 1e-3
"""Rate, Hz, at which poles below half a radian per sample are compared with those of a plant behind
a zero-order hold, and their largest distance: holds and images are not in the model."""
STEPS = 20
"""Most halvings of the steps of a count."""

FACTORS = [
    "gain(2)",
    'gain(-6,"dB")',
    'pole(3,"n")',
    'pole(300,"n")',
    'pole(30,"f")',
    'pole(30,"s")',
    'zpk([0],[9;9],1,"n")',
    'zpk([0],[20;10+i*17.3;10-i*17.3],1,"n")',
    'zpk([-6],[-60;-90],1,"f")',
    'zpk([-6],[-60;-90],1,"s")',
    'zpk([-6],[20;20],1,"n")',
    'zpk([0],[0.1;20],1,"n")',
    'zpk([],[0;20],0.1,"n")',
    'zpk([0],[],1,"n")',
    'zpk([1;2],[],1,"n")',
    'pole2(9,0.4,"n")',
    'pole2(9,5,"n")',
    'pole2(9,5,"f")',
    'zero(1,"n") pole(20,"n")',
    'zero2(5,3,"n") pole2(15,0.7,"n")',
    "rpoly([1;2],[1;30;400],100)",
    "rpoly([1],[1;40],40)",
    *(f'butter("LowPass",{n},20)' for n in (1, 2, 3, 4, 6)),
    *(f'butter("HighPass",{n},0.5)' for n in (1, 2, 4)),
    *(f'butter("BandPass",{n},0.5,9)' for n in (1, 2, 3)),
    *(f'butter("BandStop",{n},5,9)' for n in (1, 2)),
    *(f'cheby1("LowPass",{n},1,20)' for n in (1, 2, 5)),
    *(f'cheby2("LowPass",{n},40,25)' for n in (1, 2, 5)),
    *(f'ellip("LowPass",{n},1,60,12)' for n in (1, 2, 3, 4, 6)),
    'ellip("HighPass",2,1,40,0.5)',
    'ellip("BandStop",2,1,40,4,9)',
    "notch(7,10,40)",
    "notch(7,1,20)",
    "resgain(1.5,3,20)",
    "resgain(1.5,0.6,20)",
    "comb(5,10,-40,3)",
    "comb(5,10,20,2)",
    'pole(20,"n") /. setgain(1,3)',
    'sos(0.2,[-1.2;0.5;0.3;0.7],"o")',
    'sos(0.5,[-0.5;0;1;0],"o")',
    "sos([1;-1;0;-0.5;0])",
    'sos(0.5,[0;0;1;0],"o")',
    "biquad(0.2,0.1,0.3,-1.2,0.5)",
    "biquad(0.5,0,0,0.4,0)",
    "direct([0.2;0.1],[0.9])",
    "zroots([0.5],[-0.3],1)",
    "zroots([-1;0],[0.9;0.5],0.01)",
]
"""Design strings; those in z need a rate."""
PLACES = {"yaw": "torque_yaw", "x": "force_x"}
BLOCKS = {"yaw": ("yaw",), "x": ("x", "pitch")}
"""Motions that move with it."""
SIZES = {"yaw": 0.8, "x": 60.0}
"""Gains, N m/rad and N/m: a third of the stiffness of the pendulum."""


@dataclass(frozen=True)
class Case:
    """A loop: its motion, design string, sample rate, sign and delay (s)."""

    dof: str
    text: str
    rate: float
    sign: float
    delay: float = 0.0

    @property
    def source(self) -> str:
        """TOML of a pendulum with the loop."""
        given: Any = f"gain({self.sign * SIZES[self.dof]!r}) {self.text}"
        if self.rate:
            given = {"design": given, "rate": self.rate}
        loop = {
            "name": "one",
            "sensor": f"test.{self.dof}",
            "actuator": f"test.{PLACES[self.dof]}",
            "filter": given,
            "delay": self.delay,
        }
        raw: dict[str, Any] = tomllib.loads(sus.template("single").text)
        raw["control"] = {"loop": [loop]}
        raw["materials"]["steel302"]["loss_angle"] = 0.0
        return tomli_w.dumps(raw)


def cases() -> Iterator[Case]:
    """All filters at all rates, in yaw and x, of either sign."""
    for rate in RATES:
        for n, text in enumerate(FACTORS):
            yield Case("yaw", text, rate, 1.0 if n % 2 else -1.0)
            yield Case("x", text, rate, -1.0 if n % 2 else 1.0, 0.5 / rate if rate else 0.0)


class Reference:
    """Characteristic function of a loop, from roots in s of the plant and in z of the filter."""

    def __init__(self, source: Any, case: Case) -> None:
        model = registry.STRING.system(source.design)
        known = signals.bodies_with_signals(model)
        pushed = signals.parse_input(f"test.{PLACES[case.dof]}", known)
        sensed = signals.parse_output(f"test.{case.dof}", known)
        plant = statespace.build(model, [pushed], [sensed])
        self.poles = np.linalg.eigvals(plant.a)  # of a
        self.closed = np.linalg.eigvals(plant.a - plant.b @ plant.c)  # of a + b
        (loop,) = source.design.control.loop
        self.delay, self.made = case.delay, make_response(loop.filter)
        self.held: tuple[Roots, Roots] | None = None  # of a and a + b in z, behind a hold
        if case.rate == SAMPLED[0] and self.delay:
            held: Any = signal.cont2discrete((plant.a, plant.b, plant.c, plant.d), 1 / case.rate)
            a, b, c = held[:3]
            self.held = np.linalg.eigvals(a), np.linalg.eigvals(a - b @ c)

    def at(self, s: Any) -> Any:
        """Evaluate the function."""
        a, both = (_product(s, roots) for roots in (self.poles, self.closed))
        return self._close(s, a, (both - a) * np.exp(-s * self.delay))

    def at_held(self, s: Any) -> Any:
        """Evaluate that of the sampled system."""
        assert self.held is not None
        a, both = (_product(np.exp(s / self.made.rate), roots) for roots in self.held)
        return self._close(s, a, both - a)

    def _close(self, s: Any, a: Any, b: Any) -> Any:
        above, below, gain = self.filter
        unit = np.exp(s / self.made.rate) if self.made.rate else s
        return a * _product(unit, below) + b * gain * _product(unit, above)

    @cached_property
    def filter(self) -> tuple[Roots, Roots, float]:
        """Zeros, poles and gain of the filter in z, or in s."""
        made, rate = self.made, self.made.rate
        zeros, poles = (-2 * np.pi * np.array(roots) for roots in (made.zeros, made.poles))
        gain = made.gain * (2 * np.pi) ** (len(poles) - len(zeros))
        return signal.bilinear_zpk(zeros, poles, gain, rate) if rate else (zeros, poles, gain)

    def count(self) -> int:
        """Count the roots; of digital filters those of `inside`."""
        rate = self.made.rate
        if not rate:
            return len(self.poles) + len(self.made.poles)
        top, left = BESIDE * np.pi * rate, -DEPTH * rate
        ends = [left - 1j * top, rate - 1j * top, rate + 1j * top, left + 1j * top]
        turns = [self._turn(*pair) for pair in zip(ends, [*ends[1:], ends[0]], strict=True)]
        total = sum(turns) / (2 * np.pi)
        return round(total) if np.isfinite(total) else -1

    def inside(self, poles: Any) -> int:
        """Count the poles in the rectangle of `count`, both of each pair."""
        rate = self.made.rate or np.inf
        within = (poles.real > -DEPTH * rate) & (poles.imag < BESIDE * np.pi * rate)
        return int((1 + (poles.imag > 0))[within].sum())

    def _turn(self, start: complex, end: complex) -> float:
        """Compute the turn of the function along a line."""
        share = np.linspace(0.0, 1.0, 2001)
        for _ in range(STEPS):
            value = self.at(start + (end - start) * share)
            step = np.angle(value[1:] / value[:-1])
            wide = np.flatnonzero(np.abs(step) > 0.5)
            if not len(wide):
                return float(step.sum())
            share = np.sort(np.append(share, (share[wide] + share[wide + 1]) / 2))
        return np.nan


def _product(at: Any, roots: Roots) -> Any:
    return np.prod([at - root for root in roots], axis=0) if len(roots) else np.ones_like(at)


def check(case: Case) -> str:
    """Run one case, and describe its fault or refusal, if any."""
    with warnings.catch_warnings(action="ignore"):
        return _check(case)


def _check(case: Case) -> str:
    how: dict[str, Any] = {"frequency": "0.5,5", "duration": 1.0}
    ends: dict[str, Any] = {"inputs": ["support.x"], "outputs": ["test.x"]}
    try:
        source = sus.parse(case.source)
        found = sus.damp(source, fidelity="string", **how).closed
        sus.damp(source, **how)
        sus.modes(source)
        sus.response(source, closed_loop=True, allow_unstable=True, frequency="0.5,5", **ends)
        sus.export(source, **ends)
        source.foton()
    except sus.InputError as error:
        return f"refused: {error}"
    except Exception as error:
        return f"FAULT {type(error).__name__}: {error}"
    return compare(Reference(source, case), case, found)


def compare(reference: Reference, case: Case, found: Any) -> str:
    """Compare the poles of the block of the loop with the roots of the characteristic function."""
    others = {f"test.{dof}" for dof in DOFS} - {f"test.{dof}" for dof in BLOCKS[case.dof]}
    own = found.value[[name not in others for name in found.state]]
    if (off := _distance(reference.at, own)).max() > CLOSE:
        return f"FAULT poles {own} are off by {off}"
    if reference.held is not None:
        slow = own[np.abs(own) < case.rate / 2]
        if (off := _distance(reference.at_held, slow)).max() > SAMPLED[1]:
            return f"FAULT poles {slow} are off those of the sampled system by {off}"
    expected, there = reference.count(), reference.inside(own)
    return "" if expected == there else f"FAULT {there} poles for {expected}: {own}"


def _distance(function: Any, poles: Any) -> Any:
    """Estimate the relative distance of poles from the roots of a function by a Newton step."""
    step = 1e-6 * np.abs(poles)
    above, value, below = (function(poles + side * step) for side in (1, 0, -1))
    return np.abs(value * 2 * step / (above - below)) / np.abs(poles)


def main(arguments: list[str]) -> int:
    """Run the survey, or every n-th case."""
    every, faults, refused = int(arguments[0]) if arguments else 1, 0, 0
    some = list(cases())[::every]
    for case in some:
        result = check(case)
        faults += result.startswith("FAULT")
        refused += result.startswith("refused")
        if result and not result.startswith("refused"):
            print(case, result, flush=True)
    print(f"{len(some)} loops, {refused} refused, {faults} at fault")
    return int(faults > 0)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
