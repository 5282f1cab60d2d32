"""The plant of one loop, the others closed, in its modes, scaled (see `optimal_loops`)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.linear import signals
from suspension_cli.linear.joined_systems import Matrices, side_by_side
from suspension_cli.linear.statespace import StateSpace, with_constant_loss
from suspension_cli.physics import closed_loop, loop_realisation
from suspension_cli.physics.local_control import Plant
from suspension_cli.physics.wanted_loops import Wanted

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float


UNTOUCHED = 1e-12
"""The same of a mode of another symmetry, by rounding errors."""


def open_loop(plant: Plant, number: int, output: str) -> StateSpace:
    """Build the system from the force of a loop to its reading and to the output.

    The other loops are closed; the reading is that behind the loop's delay and sensor response.
    """
    model = with_constant_loss(plant.model)
    known = signals.bodies_with_signals(model)
    observed = signals.parse_output(output, known)
    others = [n for n in range(len(plant.network.nodes)) if n != number]
    rows = np.array([plant.node_sensed[number], signals.linear_form(observed, model)])
    rest = plant.with_model(model).select(others)
    pushed = plant.pushed[number][None]
    made = closed_loop.close_loops(rest, [closed_loop.LOOP], pushed, [closed_loop.LOOP] * 2, rows)
    loop = plant.loops[number]
    reading = loop_realisation.realise_reading(loop)
    behind = [Matrices(reading.A, reading.B, reading.C, reading.D), Matrices.unchanged()]
    whole = Matrices(made.a, made.b, made.c, made.d).then(side_by_side(behind))
    states = len(reading.A)
    names = (*made.state, *(f"loop {loop.name} {n}" for n in range(1, states + 1)))
    units = (*made.state_unit, *["1"] * states)
    return replace(made, a=whole.a, b=whole.b, c=whole.c, d=whole.d, state=names, state_unit=units)


@dataclass(frozen=True)
class PlantModes:
    """Poles of a plant, one of each pair, with what drives each and what it adds to the reading.

    Attributes
    ----------
    value
        Poles, rad/s.
    driven, sensed
        In the coordinate z of each, z' = value z + driven u; the reading is 2 Re(sensed z) of a
        pair, sensed z of a real pole.
    kept, weak
        Modes that are damped, and those below the highest that are hardly reached.
    """

    value: Complex[np.ndarray, " mode"]
    driven: Complex[np.ndarray, " mode"]
    sensed: Complex[np.ndarray, " mode"]
    kept: Bool[np.ndarray, " mode"]
    weak: Bool[np.ndarray, " mode"]

    @staticmethod
    def of(opened: StateSpace, wanted: Wanted) -> PlantModes:
        """Find the modes of a plant; those up to a frequency that are reached are kept."""
        own = opened.balanced()
        every, shapes = np.linalg.eig(own.a)
        driven = np.linalg.solve(shapes, own.b.astype(complex))[:, 0]
        sensed = own.c[0] @ shapes
        one = np.imag(every) >= 0
        value = every[one]
        size = np.abs(driven[one] * sensed[one]) / np.maximum(np.abs(value), 1e-300)
        low = np.abs(value) <= 2 * np.pi * wanted.highest
        reached = size > wanted.reached * size.max(initial=0.0)
        weak = low & ~reached & (size > UNTOUCHED * size.max(initial=0.0))
        return PlantModes(value, driven[one], sensed[one], low & reached, weak)

    @property
    def frequency(self) -> Float[np.ndarray, " mode"]:
        """Frequencies, Hz."""
        return np.abs(self.value) / (2 * np.pi)

    def find_hardest(self, rate: float) -> int:
        """Number of the mode that asks for most force to decay at a rate (1/s).

        A weak filter of gain g moves a pole by g driven sensed, to first order.
        """
        kept = np.flatnonzero(self.kept)
        missing = np.maximum(rate + np.real(self.value[kept]), 0.0)
        force = missing / np.abs(self.driven[kept] * self.sensed[kept])
        return int(kept[force.argmax()])

    @property
    def compliance_left(self) -> float:
        """Static response of the modes that are left out."""
        left = -self.driven * self.sensed / self.value
        twice = np.where(np.imag(self.value) > 0, 2.0, 1.0)
        return float(np.real(left * twice)[~self.kept].sum())


@dataclass(frozen=True)
class ScaledPlant:
    """The modes that are damped, as a scaled system: real blocks, unit time, force and reading.

    `unit` is its unit of time, s; `gain` the response that 1 stands for; `through` what the modes
    that are left out add.
    """

    a: Float[np.ndarray, "state state"]
    b: Float[np.ndarray, " state"]
    c: Float[np.ndarray, " state"]
    through: float
    unit: float
    gain: float

    @staticmethod
    def of(modes: PlantModes) -> ScaledPlant:
        """Scale the modes that are kept."""
        value = modes.value[modes.kept]
        driven = modes.driven[modes.kept]
        sensed = modes.sensed[modes.kept]
        unit = float(1 / np.exp(np.log(np.abs(value)).mean()))
        blocks = []
        forces = []
        readings = []
        for pole, force, reading in zip(value * unit, driven * unit, sensed, strict=True):
            # as strongly driven as sensed
            size = np.sqrt(np.abs(reading) / np.abs(force))
            drive = force * size
            sense = reading / size
            if pole.imag:
                blocks.append([[pole.real, -pole.imag], [pole.imag, pole.real]])
                forces += [drive.real, drive.imag]
                readings += [2 * sense.real, -2 * sense.imag]
            else:
                blocks.append([[pole.real]])
                forces.append(drive.real)
                readings.append(sense.real)
        from scipy.linalg import block_diag

        b = np.array(forces)
        c = np.array(readings)
        of_force = np.abs(b).max()
        of_reading = np.abs(c).max()
        gain = float(of_force * of_reading)
        a = np.asarray(block_diag(*blocks))
        return ScaledPlant(
            a, b / of_force, c / of_reading, modes.compliance_left / gain, unit, gain
        )

    def with_roll_off(self, frequency: float) -> ScaledPlant:
        """Put a Butterworth low-pass of second order, at a frequency in Hz, before the force."""
        corner = 2 * np.pi * frequency * self.unit
        count = len(self.a)
        a = np.zeros((count + 2, count + 2))
        a[:count, :count] = self.a
        a[:count, count] = self.b
        a[count, count + 1] = corner
        a[count + 1, count] = -corner
        a[count + 1, count + 1] = -np.sqrt(2) * corner
        b = np.zeros(count + 2)
        b[-1] = corner
        c = np.append(self.c, [self.through, 0.0])
        return replace(self, a=a, b=b, c=c, through=0.0)
