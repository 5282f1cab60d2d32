"""Blocks of a linear system without massless coordinates, solvable at any frequency."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import FRAME
from suspension_cli.linear import elimination, static_condensation
from suspension_cli.linear.residual import Equations, equations
from suspension_cli.linear.rigid_motion_invariance import low_parts
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact, Int

SOFT = 1e-5
"""Ratio of a blade's stiffness to that of its wires below which the tip's coordinate is counted
from where the wires hold it: elimination in doubles loses the square of the ratio."""
Matrices = tuple[np.ndarray, np.ndarray, np.ndarray]
"""K, M and C, or what is to be added to them."""


@dataclass(frozen=True)
class Elements:
    """Elements (e, ...) of matrices K + i omega C - omega^2 M."""

    stiffness: Inexact[np.ndarray, "*element"]
    mass: Inexact[np.ndarray, "*element"]
    damping: Inexact[np.ndarray, "*element"]

    def at(
        self, omega: Float[np.ndarray, " frequency"]
    ) -> Inexact[np.ndarray, "*element frequency"]:
        """Evaluate at frequencies in rad/s; real without loss."""
        heavy, damped = self.mass.nonzero(), self.damping.nonzero()
        result = np.empty(
            (*self.stiffness.shape, len(omega)),
            dtype=complex if len(damped[0]) else self.stiffness.dtype,
        )
        result[:] = self.stiffness[..., None]
        if len(heavy[0]):
            result[heavy] -= self.mass[heavy][:, None] * omega**2
        if len(damped[0]):
            result[damped] += (1j * self.damping[damped])[:, None] * omega
        return result


@dataclass(frozen=True)
class SupportForces:
    """Forces of the support's motion s on the coordinates v of a block.

    `coupling` is K, M and C towards the support; `equations`, of motion, serve for residuals.
    """

    coupling: Elements
    equations: Equations


@dataclass(frozen=True)
class CondensedBlock:
    """One block without its massless coordinates (b; the others are a), solvable at any frequency.

    Attributes
    ----------
    kept
        Coordinates with mass or damping. A blade tip with mass may be counted from where its wires
        would hold it (`_wire_held_basis`).
    mass, damping
        M and C towards the support's coordinates and the block's own.
    stiffness
        K, complex if lossy.
    massless
        Coordinates eliminated.
    force_transfer
        Forces on the kept coordinates per force on the massless ones: -K_ab K_bb^-1.
    compliance, support_stiffness
        K_bb^-1, and K_bs towards the support.
    static
        Static response to the support's motions, S = -K^-1 K_s; 0 for a motion without one.
    resonances
        Undamped, rad/s, ascending; 0 for a rigid or unstable mode.
    pattern
        Order of elimination of the coordinates.
    elements
        Of K, M and C in that order.
    absolute, relative
        On the coordinates x, and on the coordinates relative to the static response, x - S s.
    """

    kept: Int[np.ndarray, " kept"]
    mass: Float[np.ndarray, "kept 6+kept"]
    damping: Float[np.ndarray, "kept 6+kept"]
    stiffness: Inexact[np.ndarray, "kept 6+kept"]
    massless: Int[np.ndarray, " light"]
    force_transfer: Inexact[np.ndarray, "kept light"]
    compliance: Inexact[np.ndarray, "light light"]
    support_stiffness: Inexact[np.ndarray, "light 6"]
    static: Inexact[np.ndarray, "kept 6"]
    resonances: Float[np.ndarray, " mode"]
    pattern: elimination.Pattern
    elements: Elements
    absolute: SupportForces
    relative: SupportForces

    def is_driven(
        self, moves: Float[np.ndarray, "6 input"], forces: Float[np.ndarray, "coordinate input"]
    ) -> Bool[np.ndarray, " input"]:
        """Whether each input, a support motion or force, drives this block."""
        return (
            (self._acts_on @ np.abs(moves) != 0).any(0)
            | forces[self.kept].any(0)
            | forces[self.massless].any(0)
        )

    @cached_property
    def _acts_on(self) -> Float[np.ndarray, "kept 6"]:
        """1 where a motion of the support acts on a coordinate, else 0."""
        return (
            (self.stiffness[:, :6] != 0) | (self.damping[:, :6] != 0) | (self.mass[:, :6] != 0)
        ).astype(float)

    def reduce_forces(
        self, forces: Float[np.ndarray, "coordinate input"]
    ) -> Inexact[np.ndarray, "kept input"]:
        """Reduce forces on all coordinates to forces on those kept."""
        result, dropped = forces[self.kept], forces[self.massless]
        return result + self.force_transfer @ dropped if dropped.any() else result

    def factor(self, omega: Float[np.ndarray, " frequency"]) -> elimination.Factors:
        """Eliminate K + i omega C - omega^2 M body by body at frequencies in rad/s.

        Few digits are left, or none, where a part of the block resonates alone.
        """
        return self.pattern.factor(self.elements.at(omega))

    def matrices(
        self, omega: Float[np.ndarray, " frequency"]
    ) -> Inexact[np.ndarray, "kept kept frequency"]:
        """Evaluate K + i omega C - omega^2 M at frequencies in rad/s."""
        return self.pattern.assemble(self.elements.at(omega))

    def solve(
        self,
        factors: elimination.Factors,
        omega: Float[np.ndarray, " frequency"],
        moves: Float[np.ndarray, "6 input"],
        forces: Inexact[np.ndarray, "kept input"],
        drive: SupportForces,
    ) -> Inexact[np.ndarray, "kept input frequency"]:
        """Solve for coordinates, given support motions and forces.

        Far below the resonances the coordinates follow the support's motion s as x = S s + v, with

            (K + i omega C - omega^2 M) v = omega^2 (M_s + M S) s - i omega (C_s + C S) s.

        Nothing cancels here; in the equation for x all but a part of order omega^2 would. Far above
        the resonances that for x is the accurate one.
        """
        towards = drive.coupling
        right = Elements(
            forces - towards.stiffness @ moves, -towards.mass @ moves, -towards.damping @ moves
        )
        return factors.solve(right.at(omega))


def condense_blocks(model: LinearSystem) -> list[CondensedBlock]:
    """Condense all blocks of a system."""
    return [condense_block(model, number) for number in range(len(model.blocks))]


def condense_block(model: LinearSystem, number: int) -> CondensedBlock:
    """Condense one block of a system, once."""
    if number not in model.prepared:
        model.prepared[number] = _condense(model, model.blocks[number])
    return model.prepared[number]


def _condense(model: LinearSystem, block: Int[np.ndarray, " own"]) -> CondensedBlock:
    # neither outputs nor inputs act on massless tips, so these can be eliminated
    tips = np.array([_owner(model.coordinate[n]) != FRAME for n in block])
    light = model.massless[block] & tips & ~(model.damping[block] != 0).any(1)
    kept, massless = block[~light], block[light]
    full = model.stiffness if model.lossy is None else model.lossy
    if not np.iscomplexobj(full) or not np.imag(full[block]).any():
        full = np.real(full)
    basis = _wire_held_basis(model, block, ~light & (block >= 6 * (len(model.body) + 1)) & tips)
    reduced, tip_motion, free = _eliminate_tips(model, full, block, light, basis)
    order = np.argsort([_rank(model, _owner(model.coordinate[n])) for n in kept], kind="stable")
    kept, columns = kept[order], np.concatenate([np.arange(6), 6 + order])
    reduced = static_condensation.Reduced(
        *(part[order[:, None], columns] for part in (reduced.real, reduced.imag))
    )
    stiffness, stiffness_low = static_condensation.rounded(reduced)
    damping_low, free_of_damping = low_parts(model.damping, model, kept)
    positions = np.concatenate([np.arange(6), 6 + np.flatnonzero(~light)[order]])

    with_support = np.concatenate([np.arange(6), kept])
    mass, damping, damping_low = (
        model.mass[np.ix_(kept, with_support)],
        model.damping[np.ix_(kept, with_support)],
        damping_low[:, with_support],
    )
    mass_low = np.zeros_like(mass)
    if basis is not None:
        (mass, mass_low), (damping, damping_low) = (
            static_condensation.change_basis(*parts, basis[np.ix_(positions, positions)])
            for parts in ((mass, mass_low), (damping, damping_low))
        )
    high, rounding = (stiffness, mass, damping), (stiffness_low, mass_low, damping_low)
    static = static_condensation.static_response(
        reduced, np.zeros((len(kept), 6)) if model.rigid is None else model.rigid[kept], free
    )
    static = np.where(np.isfinite(static).all(0), static, 0.0)
    coupled = np.logical_or.reduce([matrix[:, 6:] != 0 for matrix in high])
    pattern = elimination.by_body([_owner(model.coordinate[n]) for n in kept], coupled)
    return CondensedBlock(
        kept=kept,
        mass=mass,
        damping=damping,
        stiffness=stiffness,
        massless=massless,
        force_transfer=-tip_motion[:, columns[6:]].T,
        compliance=np.linalg.inv(full[np.ix_(massless, massless)]),
        support_stiffness=full[np.ix_(massless, np.arange(6))],
        static=static,
        resonances=static_condensation.resonances(np.real(stiffness), mass),
        pattern=pattern,
        elements=Elements(*(matrix[pattern.row, pattern.column + 6] for matrix in high)),
        absolute=_support_forces(high, rounding),
        relative=_support_forces(
            *_relative_to_static(
                high, rounding, static, (free, np.zeros(6, dtype=bool), free & free_of_damping)
            )
        ),
    )


def _wire_held_basis(
    model: LinearSystem, block: Int[np.ndarray, " own"], tips: Bool[np.ndarray, " own"]
) -> Float[np.ndarray, "6+own 6+own"] | None:
    """Basis in which some blade `tips` are counted from where their wires would hold them.

    Rows are the support's and the block's coordinates, columns the new ones. A tip above a stiff
    wire moves with the body below, so all elements between them contain the wire's stiffness; in
    the new coordinates only the tip's own does. None if no wire on these tips is stiff enough to
    matter, or the stretching of wires is not known.
    """
    if model.stretched is None or not tips.any():
        return None
    with_support, stretching = np.concatenate([np.arange(6), block]), model.stretched
    form, tip_columns = stretching.form[:, with_support], 6 + np.flatnonzero(tips)
    allowed = stretching.allowed[np.ix_(block[tips], with_support)]
    pull = np.where(allowed, (form[:, tip_columns].T * stretching.stiffness) @ form, 0.0)
    tip_stiffness, wire_stiffness = (
        np.diag(model.stiffness)[block[tips]],
        pull[np.arange(len(tip_columns)), tip_columns],
    )
    if (tip_stiffness - wire_stiffness >= SOFT * wire_stiffness).all():
        return None
    result = np.eye(len(with_support))
    result[tip_columns] = -np.linalg.lstsq(pull[:, tip_columns], pull, rcond=None)[0]
    result[np.ix_(tip_columns, tip_columns)] = np.eye(len(tip_columns))
    return result


def _support_forces(high: Matrices, low: Matrices) -> SupportForces:
    return SupportForces(Elements(*(matrix[:, :6] for matrix in high)), equations(high, low))


def _relative_to_static(
    high: Matrices,
    low: Matrices,
    static: Inexact[np.ndarray, "kept 6"],
    free: tuple[Bool[np.ndarray, " 6"], Bool[np.ndarray, " 6"], Bool[np.ndarray, " 6"]],
) -> tuple[Matrices, Matrices]:
    """Change K, M and C to coordinates relative to the static response S.

    Towards the support each becomes A_s + A S, exactly 0 for the motions in `free`; for K only the
    rounding error of S is left.
    """
    results = []
    for number, (matrix, rounding, exact_zero) in enumerate(zip(high, low, free, strict=True)):
        coupling, coupling_low = static_condensation.residual_coupling(matrix, rounding, static)
        coupling[:, exact_zero], coupling_low[:, exact_zero] = 0.0, 0.0
        if number == 0:
            has_response = static.any(0)
            coupling, coupling_low = (
                np.where(has_response, 0.0, coupling),
                np.where(has_response, coupling + coupling_low, coupling_low),
            )
        results.append(
            (
                np.concatenate([coupling, matrix[:, 6:]], axis=1),
                np.concatenate([coupling_low, rounding[:, 6:]], axis=1),
            )
        )
    return tuple(part for part, _ in results), tuple(part for _, part in results)


def _eliminate_tips(
    model: LinearSystem,
    full: Inexact[np.ndarray, "all all"],
    block: Int[np.ndarray, " own"],
    massless: Bool[np.ndarray, " own"],
    basis: Float[np.ndarray, "6+own 6+own"] | None,
) -> tuple[static_condensation.Reduced, Inexact[np.ndarray, "light _"], Bool[np.ndarray, " 6"]]:
    """Condense the stiffness; also return the motion of tips and the force-free rigid motions."""
    with_support = np.concatenate([np.arange(6), block])
    low = model.low
    real, free = low_parts(np.real(full), model, block, None if low is None else np.real(low))
    imag, free_imag = low_parts(np.imag(full), model, block, None if low is None else np.imag(low))
    high, rounding = full[np.ix_(block, with_support)], (real + 1j * imag)[:, with_support]
    if basis is not None:
        high, rounding = static_condensation.change_basis(high, rounding, basis)
    reduced, tip_motion = static_condensation.condense_double_double(high, rounding, massless)
    return reduced, tip_motion, free & free_imag


def _owner(coordinate: str) -> str:
    """Body that a coordinate is eliminated with: for a blade's tip, the stage below."""
    return coordinate.split(".", 1)[0]


def _rank(model: LinearSystem, owner: str) -> int:
    """Rank of a body in the order of elimination: the frame, then the stages."""
    return -1 if owner == FRAME else model.body.index(owner)
