"""Normal modes: frequencies, shapes, and the body and degree of freedom that move most.

>>> from suspension_cli.design import reader
>>> from suspension_cli.models import registry
>>> model = registry.BEAM.system(reader.parse(reader.template("single", "single")))
>>> solve(model).label[:3]
['test transverse', 'test longitudinal', 'test yaw']
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import DOF_NAMES, DOFS, WIRE_MODE_NAMES
from suspension_cli.files.declared import derived, in_unit
from suspension_cli.linear import batch_modes, mode_content, quality
from suspension_cli.linear.batch_modes import Spectrum
from suspension_cli.linear.quality import Quality
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Inexact, Int

DAMPING_BAND = (0.5, 5.0)
"""Hz; band of modes to damp from the top mass (Husman et al. 2000, sections 1 and 5a)."""
TOP = "top"
"""In place of a body: the top mass of each chain, also if a stage has this name."""
COUPLED = 0.01
"""Smallest fraction of kinetic energy of a mode in the body from which it can be damped:
"strongly" coupled in the paper."""
NEAR = 2e-3
"""Relative difference of frequency below which violin modes of equal wires are listed as one."""


@dataclass(frozen=True)
class Modes:
    """Modes of one design in ascending order of omega^2: unstable modes first, then rigid ones.

    Attributes
    ----------
    coordinate
        The N - 6 coordinates of `shape`.
    omega_squared
        (rad/s)^2; |s|^2 for a damped mode, negative for an unstable mode, exactly 0 for a rigid or
        an overdamped one.
    shape
        Of unit modal mass; positive in the body coordinate with most kinetic energy.
    energy
        Fraction of the mode's kinetic energy in each degree of freedom of each body.
    tip_energy
        Fraction in each blade tip's motion on its blade; with `energy` it sums to 1.
    block
        Modes of different blocks do not couple.
    q
        Quality factor from the design's loss angles and dampers; infinite without loss. First
        order in the loss from `solve`, exact from `linear.damped`.
    dilution
        Total energy over the energy in lossy elements (beam and violin models; else NaN).
    wire
        Motions of wires with mass: ``test.violin-x``, ``test.twist``, ... (violin model), and the
        light of detuned cavities: ``arm.light``.
    wire_energy
        Fraction in each of these; with `energy` and `tip_energy` it sums to 1.
    order
        Number of half waves along the wires in a wire mode; 0 for other modes.
    decay_rate
        Of the amplitude, 1/s; 0 for a mode that is rigid, lossless or grows without oscillating,
        negative for one that oscillates and grows.
    top
        Number of the top mass of each body's chain, as in `LinearSystem`.
    damping_band
        Lowest and highest frequency (Hz) at which modes can be damped; empty for no verdict.
    damping_at
        Body from which they are damped, or ``top``.
    """

    body: tuple[str, ...]
    coordinate: tuple[str, ...]
    omega_squared: Float[np.ndarray, " mode"] = field(metadata=in_unit("rad^2/s^2"))
    shape: Float[np.ndarray, "mode coordinate"] = field(metadata=in_unit("{shape_unit}"))
    energy: Float[np.ndarray, "mode body degree_of_freedom"]
    tip_energy: Float[np.ndarray, "mode tip"]
    block: Int[np.ndarray, " mode"]
    q: Float[np.ndarray, " mode"]
    dilution: Float[np.ndarray, " mode"]
    wire: tuple[str, ...]
    wire_energy: Float[np.ndarray, "mode wire"]
    order: Int[np.ndarray, " mode"]
    decay_rate: Float[np.ndarray, " mode"] = field(metadata=in_unit("1/s"))
    top: tuple[int, ...] = ()
    damping_band: tuple[float, ...] | None = DAMPING_BAND
    damping_at: str | None = TOP

    @property
    @derived()
    def degree_of_freedom(self) -> tuple[str, ...]:
        """Degrees of freedom of a body."""
        return DOFS

    @property
    @derived()
    def tip(self) -> tuple[str, ...]:
        """Coordinates that do not belong to bodies: of blade tips and the support structure."""
        return self.coordinate[6 * len(self.body) :]

    @property
    @derived(along="coordinate")
    def shape_unit(self) -> tuple[str, ...]:
        """Unit of each coordinate of a shape."""
        turns = tuple(f".{dof}" for dof in DOFS[3:])
        return tuple(f"kg^-0.5{'/m' * name.endswith(turns)}" for name in self.coordinate)

    @property
    @derived("Hz")
    def frequency(self) -> Float[np.ndarray, " mode"]:
        """Frequency in Hz; 0 for a rigid mode, NaN for an unstable or overdamped one."""
        none = (self.growth_rate > 0) | self.overdamped
        return np.sqrt(np.where(none, np.nan, self.omega_squared)) / (2 * np.pi)

    @property
    def overdamped(self) -> Bool[np.ndarray, " mode"]:
        """Whether each mode decays without oscillating."""
        return (self.omega_squared == 0) & (self.decay_rate > 0)

    @property
    @derived("1/s")
    def growth_rate(self) -> Float[np.ndarray, " mode"]:
        """Growth rate of the amplitude in 1/s; 0 for a stable mode."""
        return np.where(
            self.omega_squared < 0,
            np.sqrt(np.abs(self.omega_squared)),
            np.maximum(-self.decay_rate, 0.0),
        )

    @property
    @derived()
    def stable(self) -> bool:
        """Whether no mode grows."""
        return not bool(self.growth_rate.any())

    @cached_property
    def fractions(self) -> Float[np.ndarray, "mode place"]:
        """Fraction of kinetic energy in each motion of `place`."""
        return np.concatenate(
            [self.energy.reshape(len(self.energy), -1), self.tip_energy, self.wire_energy], axis=1
        )

    @property
    def place(self) -> tuple[str, ...]:
        """Names of all motions with kinetic energy: coordinates, then motions of wires."""
        return (*self.coordinate, *self.wire)

    @cached_property
    def home(self) -> list[tuple[str, str]]:
        """Body (blade, wires) and degree of freedom with most of each mode's kinetic energy."""
        return [place(self.place[n]) for n in mode_content.leading(self.fractions).tolist()]

    @cached_property
    def motion(self) -> list[str]:
        """Body and motion with most kinetic energy of each mode in words: ``test pitch``."""
        return [
            describe(f"{body}.{dof}") + (f" {order}" if order else "")
            for (body, dof), order in zip(self.home, self.order, strict=True)
        ]

    @cached_property
    @derived(along="mode")
    def label(self) -> list[str]:
        """Names of the modes: their `motion`, and ``#2`` for the second with the same one."""
        return mode_content.number_labels(self.motion)

    def with_label(self, text: str) -> list[int]:
        """Numbers of the modes, from 0, with a label; of all with a motion."""
        names = zip(self.motion, self.label, strict=True)
        return [n for n, both in enumerate(names) if text in both]

    @cached_property
    def top_mass(self) -> Int[np.ndarray, " mode"]:
        """Number of the top mass of the chain in which each mode has most kinetic energy."""
        return find_top_masses(self.energy, self.top)

    @property
    @derived()
    def top_fraction(self) -> Float[np.ndarray, " mode"]:
        """Fraction of each mode's kinetic energy in its top mass."""
        return self.energy[np.arange(len(self.energy)), self.top_mass].sum(-1)

    @property
    def damping_fraction(self) -> Float[np.ndarray, " mode"]:
        """Fraction of each mode's kinetic energy in the body from which it is damped."""
        if self.damping_at == TOP or self.damping_at not in self.body:
            return self.top_fraction
        return self.energy[:, self.body.index(self.damping_at)].sum(-1)

    @property
    @derived(along="mode")
    def verdict(self) -> list[str]:
        """Whether each mode can be damped (Husman et al. 2000), in words; empty for no verdict."""
        band = DAMPING_BAND if self.damping_band is None else self.damping_band
        low, high = (band[0], band[-1]) if band else (0.0, np.inf)

        def judge(growth: float, frequency: float, fraction: float) -> str:
            if growth > 0 and not frequency > 0:
                return "unstable"
            if not frequency > 0:
                return "rigid" if frequency == 0 else "overdamped"
            if not low <= frequency <= high:
                return f"below {low:g} Hz" if frequency < low else f"above {high:g} Hz"
            couples = "can be damped" if fraction >= COUPLED else "couples weakly"
            return couples if band else ""

        return list(map(judge, self.growth_rate, self.frequency, self.damping_fraction))

    @property
    def groups(self) -> list[list[int]]:
        """Mode numbers in order, with close violin modes of one stage's wires grouped."""

        def family(n: int) -> tuple[object, ...]:
            body, motion = self.home[n]
            return self.order[n], body, motion[:5]

        result: list[list[int]] = []
        for n, order in enumerate(self.order):
            last = result[-1][-1] if result else n
            near = self.frequency[n] - self.frequency[last] < NEAR * self.frequency[n]
            if last != n and order and near and family(n) == family(last):
                result[-1].append(n)
            else:
                result.append([n])
        return result

    def up_to(self, highest: float) -> Modes:
        """Select the modes up to a frequency (Hz); those that do not oscillate are kept."""
        return self.select(self.omega_squared <= (2 * np.pi * highest) ** 2)

    def select(
        self, chosen: slice | Int[np.ndarray, " chosen"] | Bool[np.ndarray, " mode"]
    ) -> Modes:
        """Select modes by number or mask."""
        return replace(self, **{name: getattr(self, name)[chosen] for name in PER_MODE})

    def followed_by(self, *others: Modes) -> Modes:
        """Append modes of the same design."""
        parts = {name: [getattr(each, name) for each in (self, *others)] for name in PER_MODE}
        return replace(self, **{name: np.concatenate(part) for name, part in parts.items()})

    def ascending(self) -> Modes:
        """Sort them; those that do not oscillate are first, overdamped ones last of these."""
        order = np.argsort(np.where(self.overdamped, self.decay_rate, 0.0), kind="stable")
        return self.select(order[batch_modes.ascending(self.omega_squared[order])])

    def of(self, dof: str, body: str | None = None) -> list[float]:
        """List frequencies (Hz) of stable modes whose `home` is a degree of freedom (of a body)."""
        return [
            float(frequency)
            for frequency, home in zip(self.frequency, self.home, strict=True)
            if home[1] == dof and body in (None, home[0]) and np.isfinite(frequency)
        ]


PER_MODE = tuple(one.name for one in fields(Modes) if "mode" in str(one.type))
"""Attributes of `Modes` with one entry per mode."""


def find_top_masses(
    energy: Float[np.ndarray, "mode body 6"], top: tuple[int, ...]
) -> Int[np.ndarray, " mode"]:
    """Number of the top mass of the chain in which each mode has most kinetic energy.

    Of chains whose energies are equal but for rounding, the first.
    """
    own = np.array(top or (0,) * energy.shape[1])
    chains = energy.sum(-1) @ (own[:, None] == np.arange(len(own)))
    return np.argmax(chains >= chains.max(-1, keepdims=True) - 1e-9, axis=-1)


def place(coordinate: str) -> tuple[str, str]:
    """Split a coordinate's name into body (or blade) and degree of freedom."""
    body, _, dof = coordinate.rpartition(".")
    return body, dof


def describe(coordinate: str) -> str:
    """Describe a coordinate in words: ``test pitch``, ``upper.blade1 tip vertical``."""
    body, dof = place(coordinate)
    part = ""
    if body.count(".") == 2:  # on the tip of a blade
        body, _, part = body.rpartition(".")
        part = f" {part}"
    elif "." in body:
        part = " tip"
    return f"{body}{part} {DOF_NAMES.get(dof) or WIRE_MODE_NAMES[dof]}"


def solve(model: LinearSystem, known: Spectrum | None = None) -> Modes:
    """Solve for the undamped modes of a linear system without batch axes.

    Damping and loss enter Q and the decay rate to first order only. The modes may be `known` as
    arrays.
    """
    found = batch_modes.solve(model) if known is None else known
    value = np.sqrt(-found.omega_squared + 0j)
    first = quality.evaluate(model, value, found.motion, wires=False)
    decays = np.minimum(np.real(first.value), 0.0) + 1j * np.imag(value)
    first = replace(first, value=np.where(np.imag(value) > 0, decays, value))
    return build(model, value, found.motion, found.block, first)


def build(
    model: LinearSystem,
    value: Complex[np.ndarray, " mode"],
    motion: Inexact[np.ndarray, "mode coordinate"],
    block: Int[np.ndarray, " mode"],
    found: Quality,
) -> Modes:
    """Build modes from their poles s (rad/s; 0: rigid), shapes of unit modal mass and quality."""
    oscillates = np.imag(value) > 0
    rate = np.real(found.value)
    squared = np.where(oscillates, np.abs(value) ** 2, -(np.maximum(rate, 0.0) ** 2))
    decay = np.where(oscillates, -rate, np.maximum(-rate, 0.0)) + 0.0
    body, tips = (
        found.bodily[:, None] * part for part in mode_content.energy_fractions(model, motion)
    )
    lead = 6 + np.concatenate([body, tips], axis=1).argmax(1)
    shape = real_shapes(motion) @ model.basis.T
    shape *= np.where(shape[np.arange(len(lead)), lead] < 0, -1.0, 1.0)[:, None]
    return Modes(
        body=model.body,
        coordinate=model.coordinate[6:],
        omega_squared=squared,
        shape=shape[:, 6:],
        energy=body.reshape(len(lead), -1, 6),
        tip_energy=tips,
        block=block,
        q=found.q,
        dilution=found.dilution,
        wire=(),
        wire_energy=np.zeros((len(lead), 0)),
        order=np.zeros(len(lead), dtype=np.intp),
        decay_rate=decay,
        top=model.top,
    )


def real_shapes(
    motion: Inexact[np.ndarray, "mode coordinate"],
) -> Float[np.ndarray, "mode coordinate"]:
    """Real shapes: complex ones at the phase of largest displacement, of the same norm."""
    if np.isrealobj(motion):
        return motion
    turn = np.angle((motion**2).sum(1)) / 2
    shape = (motion * np.exp(-1j * turn)[:, None]).real
    size = np.sqrt((shape**2).sum(1))
    whole = np.sqrt((np.abs(motion) ** 2).sum(1))
    return shape * (whole / np.where(size > 0, size, 1.0))[:, None]
