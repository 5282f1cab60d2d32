"""The choice of the fewest states that give the asked responses of a lossy system.

A system has the states of its bodies, and candidates for more (`relaxation.Candidate`): each adds a
stiffness g f(omega) u^T u along one deformation u, of a strength g >= 0. With the exact motions x
by the inputs, and those y by forces along the outputs, this changes a response, and the pole s of a
mode of unit mass with the shape v, by

    dH = -g f(omega) (y . u) (u . x),    d(s^2) = -g f(omega) (u . v)^2,

which is linear in the strengths. What all losses and modes of wires change is known in the same
form. Per group of coordinates that couple, strengths are found by least squares with g >= 0,
relative to the responses across the band, and to the widths of the modes in it. Candidates are
added one by one, that first which lowers the error most per state.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses.export.relaxation import WIRE, Candidates
from suspension_cli.linear import response, signals
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.solver import Solver

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

    from suspension_cli.analyses.export.relaxation import Candidate
    from suspension_cli.scene.arrays import Array, Index

GAIN = 1e-3
"""Relative improvement of the error below which a group gets no more states."""
STRONG = 0.06
"""Cost of a candidate of strength 1, that of the losses themselves, over the error that is enough:
strengths that cancel are no solution beyond first order."""
BY_LOSSES = 0.1
"""Change of a response by losses beyond which it counts less: of one by losses alone the real part
cannot be right, as a loss angle that does not depend on frequency is not causal."""
MOST_ROWS = 8000
"""Responses at frequencies that are compared: as many of more, at random."""
MOST = 200
"""Most candidates that are added in a group."""


@dataclass(frozen=True)
class Step:
    """Strengths of the candidates of one group after a step, and the error that is expected."""

    strength: Float[np.ndarray, " candidate"]
    error: float


@dataclass(frozen=True)
class Group:
    """The least-squares problem of one group of coordinates that couple.

    Attributes
    ----------
    output, input
        Numbers of the signals of each response through the group.
    change
        Relative change by each candidate of strength 1, with the sign reversed: of each response at
        each frequency, then of s^2 of each mode, of which 1 is twice the imaginary part.
    target
        That by all losses and modes of wires.
    weight
        Weight of each, which `change` and `target` contain.
    in_quadrature
        Weight of the imaginary part of each; of modes it is the error of the frequency.
    modes
        Number of modes, the last rows.
    states
        Number of states of each candidate.
    always
        Candidates that take part from the start.
    """

    output: Int[np.ndarray, " pair"]
    input: Int[np.ndarray, " pair"]
    change: Complex[np.ndarray, "row candidate"]
    target: Complex[np.ndarray, " row"]
    weight: Float[np.ndarray, " row"]
    in_quadrature: Float[np.ndarray, " row"]
    modes: int
    states: Int[np.ndarray, " candidate"]
    always: Bool[np.ndarray, " candidate"]

    def corrected(
        self, strength: Float[np.ndarray, " candidate"], error: Complex[np.ndarray, " row"]
    ) -> Group:
        """Correct the target by the errors of some strengths that are not linear in these."""
        expected = self.target - self.change @ strength
        seen = self.change.any(1)
        return replace(
            self, target=self.target + np.where(seen, self.weight * error - expected, 0.0)
        )

    def choose(self, enough: float) -> list[Step]:
        """Choose candidates, one more per step, until the largest error is `enough`.

        Those without states take part from the first step on.
        """
        from scipy.optimize import nnls

        count = len(self.states)
        if not len(self.output) or not count:
            return [Step(np.zeros(count), 0.0)]
        some = np.arange(len(self.target))
        if len(some) > MOST_ROWS:
            some = np.random.default_rng(0).permutation(len(some))
            some = np.append(some[:MOST_ROWS], np.arange(len(some) - self.modes, len(some)))
        change: Any = self.change[some]
        target: Any = self.target[some]
        matters = self.in_quadrature[some]
        size = np.sqrt((np.abs(change) ** 2).sum(0))
        scale = np.sqrt(size**2 + (STRONG * enough) ** 2)
        quadrature = matters[:, None] * change.imag
        rows = np.concatenate([change.real, quadrature, STRONG * enough * np.eye(count)]) / scale
        rows = np.asfortranarray(rows)
        wanted = np.concatenate([target.real, matters * target.imag, np.zeros(count)])
        # the same least squares with no more rows than columns
        small: Any = np.linalg.qr(np.column_stack([rows, wanted]), mode="r")
        columns = small[:, :-1]
        right = small[:, -1]
        usable = size > 0
        free = self.always | (self.states == 0)
        active = usable & free
        steps = list[Step]()
        for _ in range(MOST):
            strength = np.zeros(count)
            if active.any():
                strength[active] = nnls(columns[:, active], right)[0]
            off = rows[: 2 * len(target), active] @ strength[active] - wanted[: 2 * len(target)]
            error = float(np.abs(off).max())
            steps.append(Step(strength / scale, error))
            if error <= enough:
                break
            usable &= free | ~active | (strength > 0)
            active &= usable
            slope = columns.T @ (right - columns @ strength) / np.sqrt(np.maximum(self.states, 1))
            slope[active | ~usable] = 0.0
            best = int(slope.argmax())
            if slope[best] <= GAIN * enough:
                break
            active[best] = True
        return steps


def _merge(groups: list[list[Step]]) -> list[list[Array]]:
    """Merge the steps of groups: each time that of the group of the largest error is next."""
    at = [0] * len(groups)
    merged = []
    while True:
        merged.append([steps[n].strength for steps, n in zip(groups, at, strict=True)])
        more = [
            (steps[n].error, k)
            for k, (steps, n) in enumerate(zip(groups, at, strict=True))
            if n + 1 < len(steps)
        ]
        if not more:
            return merged
        at[max(more)[1]] += 1


def choose_states(groups: list[Group], enough: float) -> list[list[Array]]:
    """Choose the strengths of all candidates (by group), step by step with more states."""
    return _merge([group.choose(enough) for group in groups])


def correct(
    groups: list[Group],
    strengths: list[Array],
    error: Complex[np.ndarray, "frequency output input"],
    error_of_modes: Complex[np.ndarray, " mode"],
) -> list[Group]:
    """Correct what is wanted by the errors of some strengths that are not linear in these.

    The errors are relative as those of the groups.
    """
    shared = np.zeros(error.shape[1:])
    for group in groups:
        shared[group.output, group.input] += 1
    error = error / np.maximum(shared, 1)
    return [
        group.corrected(
            strength,
            np.append(error[:, group.output, group.input].ravel(), error_of_modes),
        )
        for group, strength in zip(groups, strengths, strict=True)
    ]


@dataclass(frozen=True)
class Wanted:
    """What states are chosen for.

    Attributes
    ----------
    inputs, outputs
        Signals.
    frequency
        At which responses are to be right, Hz.
    size
        What their errors are relative to; 0 where no response is.
    pole, shape
        Modes whose Q is to be right: s with Im s > 0, rad/s, and shapes of unit mass.
    in_quadrature
        Weight of an error of their frequency, over one of Q.
    """

    inputs: list[Signal]
    outputs: list[Signal]
    frequency: Float[np.ndarray, " frequency"]
    size: Float[np.ndarray, "frequency output input"]
    pole: Complex[np.ndarray, " mode"]
    shape: Float[np.ndarray, "mode coordinate"]
    in_quadrature: Float[np.ndarray, " mode"]

    @property
    def width(self) -> Complex[np.ndarray, " mode"]:
        """What errors of s^2 are relative to: twice the imaginary part, as Q may be off by that."""
        return 2j * np.abs(np.imag(self.pole**2))


def pose(solver: Solver, candidates: Candidates, wanted: Wanted) -> list[Group]:
    """Pose the least-squares problem of each group of coordinates of the exact system."""
    omega = np.append(2 * np.pi * wanted.frequency, np.abs(wanted.pole))
    lost = [one.at(omega) for one in candidates.losses]
    pairs = zip(candidates.groups, candidates.lossy_rows, strict=True)
    return [
        _pose(solver, own, list(zip(rows, lost, strict=True)), omega, wanted) for own, rows in pairs
    ]


def _pose(
    solver: Solver,
    candidates: list[Candidate],
    losses: list[tuple[Array, Array]],
    omega: Float[np.ndarray, " frequency_or_mode"],
    wanted: Wanted,
) -> Group:
    """Pose the least-squares problem of one group, of the deformations and values of losses."""
    count = len(candidates)
    states = np.array([one.states for one in candidates], dtype=int)
    wires = np.array([one.kind == WIRE for one in candidates], dtype=bool)
    rows = np.concatenate(
        [
            np.zeros((0, solver.system.size)),
            *(one.row[None] for one in candidates),
            *(part for part, _ in losses),
        ]
    )
    deformations, which = np.unique(rows, axis=0, return_inverse=True)
    outputs, inputs, product = _products(solver, deformations, wanted)
    moved = wanted.shape @ deformations.T
    product = np.concatenate(
        [product.reshape(-1, len(deformations)), moved**2 / wanted.width[:, None]]
    )
    repeated = np.append(
        np.full(len(wanted.frequency), len(outputs)), np.ones(len(wanted.pole), int)
    )
    change = np.empty((len(product), count), dtype=complex)
    for n, one in enumerate(candidates):
        change[:, n] = product[:, which[n]] * np.repeat(one.at(omega), repeated)
    target = np.zeros(len(product), dtype=complex)
    first = count
    for rows, value in losses:
        own = which[first : first + len(rows)]
        target += product[:, own].sum(1) * np.repeat(value, repeated)
        first += len(rows)
    weight = 1 / np.maximum(np.abs(target) / BY_LOSSES, 1.0) ** 2
    weight[len(weight) - len(wanted.pole) :] = 1.0
    target += change[:, wires].sum(1)
    highest = 2 * np.pi * wanted.frequency[-1]
    inside = np.array([one.rate <= highest for one in candidates], dtype=bool)
    quadrature = np.append(np.ones(len(wanted.frequency) * len(outputs)), wanted.in_quadrature)
    change *= weight[:, None]
    return Group(
        outputs,
        inputs,
        change,
        weight * target,
        weight,
        quadrature,
        len(wanted.pole),
        states,
        wires & inside,
    )


def _products(
    solver: Solver, deformations: Float[np.ndarray, "deformation coordinate"], wanted: Wanted
) -> tuple[Index, Index, Complex[np.ndarray, "frequency pair deformation"]]:
    """Return outputs and inputs of responses by deformations, and (y . u)(u . x) over `size`."""
    model = solver.system
    omega = 2 * np.pi * wanted.frequency
    drives = np.array([signals.linear_form(signal, model) for signal in wanted.inputs])
    rows = np.array([signals.linear_form(signal, model) for signal in wanted.outputs])
    acts = [signal.acts for signal in wanted.inputs]
    forces = [True] * len(deformations)
    moved, _ = response.transfer(solver, omega, drives, acts, deformations)
    pushed, _ = response.transfer(solver, omega, deformations, forces, rows)
    reached = np.any(pushed, axis=(0, 2))[:, None] & np.any(moved, axis=(0, 1))
    outputs, inputs = np.nonzero(reached & wanted.size.all(0))
    size = wanted.size[:, outputs, inputs, None]
    product = pushed[:, outputs] * np.swapaxes(moved, 1, 2)[:, inputs] / size
    return outputs, inputs, product
