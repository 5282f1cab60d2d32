"""Upper estimates of what wire mass changes, without solving for modes; first violin modes.

Inertia. Far below its violin modes a wire whose ends move by a and b is a straight line, with the
kinetic energy m (a^2 + a.b + b^2) / 6 (any text on finite elements; `moments` for one of several
sections). With the mass matrices M of the bodies and W of such wires, a frequency of the bodies
falls by a fraction between 0 and beta / 2, where beta is the largest eigenvalue of M^-1 W
(Rayleigh's principle). Off resonance, the response of each stage goes with 1 / M, so that of n
stages changes by up to n beta. A clamped wire turns about a hinge at u = sqrt(EI / T) from its
clamp (Gonzalez and Saulson, J. Acoust. Soc. Am. 96, 207 (1994)), so its ends are taken there; u is
at most 0.16 l, as for a beam without tension (whose mass matrix has 13/35, 11/210 and 1/105).

Waves. Let the upper end of a string of length L rest and its lower end move by x at omega. Its
slope is k x / sin(k L) at the upper end and k x cos(k L) / sin(k L) at the lower one, with k L = pi
f / f1 and f1 = sqrt(T / mu) / (2 L) its first violin mode (any text on vibrations). Its force on
the far end is k L / sin(k L) times that of a massless wire, so a response changes by X^2 / 6, X = k
L. Loss acts at the ends, where the wire bends, and goes with the square of the slope there:

    upper: (x/L)^2 (1 + X^2/3 + ...),    lower: (x/L)^2 (1 - 2 X^2/3 + ...).

So the amplitude of the noise without mass is wrong by up to X^2/3 (lower end, which has the larger
error; X^2/12 for the mean of both).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.equilibrium import clamps
from suspension_cli.equilibrium.hanging import hang
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.errors import InputError
from suspension_cli.rotations import cross_matrix
from suspension_cli.scene import fibres
from suspension_cli.scene.arrays import Array, Index
from suspension_cli.scene.composition import Fibre
from suspension_cli.scene.scene import Scene

VALID = 0.5
"""Frequency over the first violin mode, above which the series are not valid."""
FORCE = np.pi**2 / 6
"""Relative change of the force of a wire on its far end, over (f/f1)^2."""
NOISE = np.pi**2 / 3
"""Largest relative change of a wire's thermal noise (amplitude), over (f/f1)^2."""
HINGE = 0.16
"""Largest distance from a clamp to the point about which the wire turns, over its length."""


@dataclass(frozen=True)
class MassEffect:
    """Effect of wire mass up to some frequency, at most.

    Attributes
    ----------
    inertia
        Effect of the wires' inertia: the number of stages times the largest ratio of the wires'
        kinetic energy to that of the bodies.
    waves
        Effect of waves on the wires, all stages together; infinite near violin modes.
    highest, lowest
        That frequency and the lowest first violin mode, Hz.
    wire
        The wire that has this mode; "" if none has one.
    """

    inertia: float
    waves: float
    highest: float
    lowest: float
    wire: str

    @property
    def error(self) -> float:
        """Relative change of the result."""
        return self.inertia + self.waves

    @property
    def where(self) -> str:
        """The larger of the two causes, in words."""
        if self.inertia > self.waves:
            size = percent(self.inertia)
            return f"the kinetic energy of wires is up to {size} of that of bodies"
        return (
            f"the highest frequency is {self.highest:.4g} Hz, the lowest violin mode"
            f" {self.lowest:.4g} Hz, wire {self.wire}"
        )


def effect_on_noise(design: Design, highest: float) -> MassEffect:
    """Estimate the largest change of thermal noise by wire mass, up to a frequency in Hz."""
    return massive_wires(as_hanging(expand_with_fibres(design))).effect_on_noise(highest)


def expand_with_fibres(design: Design) -> Scene:
    """Expand a design into its scene, with the composition of its wires where it is known."""
    scene = expand(design)
    if fibres.explain_unsuitable(design, massive=False):
        return scene
    return replace(scene, fibres=clamps.compose(design))


def as_hanging(scene: Scene) -> Scene:
    """Give wires the lengths, tensions and directions at which they hang as strings.

    Nothing changes where the pose is as drawn, or where strings do not hang.
    """
    if scene.fibres is None or not scene.solves_pose:
        return scene
    try:
        now = hang(scene)
    except InputError:
        return scene
    span = now.upper * now.length[:, None]
    wires = replace(scene.wires, span=span, length=now.length, tension=now.tension)
    return replace(scene, wires=wires)


@dataclass(frozen=True)
class MassiveWires:
    """First violin modes of all wires of a design, and their inertia.

    Attributes
    ----------
    lower : (w,) int array
        Number of the body that hangs on each.
    first : (w,) array
        First violin modes, Hz.
    inertia
        Relative change of responses by the inertia of all wires, at most.
    """

    label: tuple[str, ...]
    lower: Index
    first: Array
    inertia: float

    def effect_on_response(self, highest: float) -> MassEffect:
        """Estimate the largest change of responses by wire mass, up to a frequency in Hz."""
        return self.effect(highest, FORCE)

    def effect_on_noise(self, highest: float) -> MassEffect:
        """Estimate the largest change of thermal noise by wire mass, up to a frequency in Hz."""
        return self.effect(highest, NOISE)

    def effect(self, highest: float, slope: float) -> MassEffect:
        """Estimate the largest change of a result that waves change by `slope` (f/f1)^2."""
        if not np.isfinite(self.first).any():
            return MassEffect(0.0, 0.0, highest, np.inf, "")
        near = np.array(
            [
                (highest / max(self.first[self.lower == body].min(), 1e-150)) ** 2
                for body in sorted(set(self.lower.tolist()))
            ]
        )
        waves = slope * float(near.sum()) if near.max() < VALID**2 else np.inf
        lowest = int(np.argmin(self.first))
        return MassEffect(
            self.inertia, waves, highest, float(self.first[lowest]), self.label[lowest]
        )


def massive_wires(scene: Scene) -> MassiveWires:
    """Compute what the effects of wire mass depend on; scene from `as_hanging`, with `fibres`."""
    assert scene.fibres is not None
    made = scene.fibres.wire
    lower, tension = scene.wires.lower, scene.wires.tension
    first = np.array([first_violin_of(one, float(t)) for one, t in zip(made, tension, strict=True)])
    inertia = 0.0
    if np.isfinite(first).any():
        inertia = len(set(lower.tolist())) * _largest_load(scene, made)
    return MassiveWires(tuple(one.label for one in made), lower, first, inertia)


def _largest_load(scene: Scene, made: tuple[Fibre, ...]) -> float:
    """Largest ratio of the wires' kinetic energy to that of bodies and blade tips.

    On a blade whose tip has no mass, a wire's upper end follows the lower one up and down.
    """
    bodies, blades, wires = scene.bodies, scene.blades, scene.wires
    count = 6 * len(bodies.name)
    tips = np.flatnonzero(blades.tip_mass > 0)
    size = 6 + count + 3 * len(tips)
    mass = np.zeros((size, size))
    for n in range(len(bodies.name)):
        at = 6 * (n + 1)
        mass[range(at, at + 3), range(at, at + 3)] = bodies.mass[n]
        mass[at + 3 : at + 6, at + 3 : at + 6] = bodies.inertia[n]
    for n, blade in enumerate(tips):
        at = 6 + count + 3 * n
        mass[range(at, at + 3), range(at, at + 3)] = blades.tip_mass[blade]
    numbers = [
        (*moments(fibre), hinge_distance(fibre, tension))
        for fibre, tension in zip(made, wires.tension.tolist(), strict=True)
    ]
    first, mixed, last, distance = (part[:, None, None] for part in np.array(numbers).T)
    reach = distance[..., 0] * wires.span / wires.length[:, None]
    lower = _points(size, wires.lower, wires.lower_point - reach)
    upper = _points(size, wires.upper, wires.upper_point + reach)
    for w in np.flatnonzero(wires.blade >= 0).tolist():
        blade = int(wires.blade[w])
        axes = blades.axes[blade]
        if blade in tips:
            own = 6 + count + 3 * int(np.flatnonzero(tips == blade)[0])
            upper[w, axes] = np.eye(size)[own : own + 3][axes]
        else:
            upper[w, axes] = lower[w, axes]
    both = np.swapaxes(first * upper + mixed * lower, 1, 2) @ upper
    both += np.swapaxes(mixed * upper + last * lower, 1, 2) @ lower
    added = both.sum(0)
    moves = np.diag(mass) > 0
    half = np.linalg.inv(np.linalg.cholesky(mass[np.ix_(moves, moves)]))
    return float(np.linalg.eigvalsh(half @ added[np.ix_(moves, moves)] @ half.T)[-1])


def hinge_distance(fibre: Fibre, tension: float) -> float:
    """Distance from a wire's ends as designed to the points where it bends, m."""
    if fibre.effective:
        return 0.0
    rigidity = max(max(section.rigidity) for section in (fibre.sections[0], fibre.sections[-1]))
    length = sum(section.length for section in fibre.sections)
    return min(float(np.sqrt(rigidity / tension)), HINGE * length) if tension > 0 else 0.0


def moments(fibre: Fibre) -> tuple[float, float, float]:
    """Integrals of (1 - s)^2, s (1 - s) and s^2 over the mass of a wire, kg.

    s rises from 0 at its upper end to 1 at the lower one; m/3, m/6 and m/3 for a uniform wire.
    """
    ends = np.cumsum([0.0, *(section.length for section in fibre.sections)])
    ends /= ends[-1]
    mass = np.array([section.length * section.mass for section in fibre.sections])
    width, middle = np.diff(ends), (ends[1:] + ends[:-1]) / 2
    square = float((mass * (middle**2 + width**2 / 12)).sum())
    single, total = float((mass * middle).sum()), float(mass.sum())
    return total - 2 * single + square, single - square, square


def _points(size: int, body: Index, arm: Array) -> Array:
    """Motions of points of bodies per coordinate, (w, 3, size)."""
    result = np.zeros((len(body), 3, size))
    wire, along = np.arange(len(body))[:, None], np.arange(3)
    result[wire, along, 6 * body[:, None] + along] = 1.0
    turned = 6 * body[:, None, None] + 3 + along
    result[wire[..., None], along[:, None], turned] = -cross_matrix(arm)
    return result


def percent(value: float) -> str:
    """A relative change in per cent, to two digits: "0.012 %"; rounding errors are "0 %"."""
    return f"{0 if value < 1e-15 else float(f'{100 * value:.2g}'):g} %"


def first_violin_of(fibre: Fibre, tension: float) -> float:
    """First violin mode of one wire as a string, sqrt(T / m_w / l) / 2, Hz; 0 if it is slack."""
    mass, length = (
        sum(s.mass * s.length for s in fibre.sections),
        sum(s.length for s in fibre.sections),
    )
    return float(np.sqrt(max(tension, 0.0) / (mass * length))) / 2 if mass > 0 else np.inf
