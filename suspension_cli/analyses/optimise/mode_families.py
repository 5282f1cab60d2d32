"""Identification of modes across designs: by family and rank, or followed by shape.

Mirror symmetries split motions into families that do not couple: longitudinal with pitch,
transverse with roll, vertical, yaw. Within a family, frequencies generally do not cross (von
Neumann and Wigner, Phys. Z. 30, 467 (1929)), so that the rank of a mode identifies it in any
design, and its frequency changes smoothly. A mode with a label is followed by shape along the
straight line between two designs (`mode_tracking`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.modes import wire_modes
from suspension_cli.conventions import DOF_NAMES, DOFS, PARITY_X, PARITY_Y
from suspension_cli.linear import batch_modes, eigenmodes
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.frequency_terms import WireTerm
from suspension_cli.linear.mode_pairing import body_overlap, pair_by_overlap, pair_by_shape
from suspension_cli.linear.system import LinearSystem
from suspension_cli.studies import builds, mode_tracking, variants

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

HIGHEST = 1.05
"""Highest frequency of the search for modes of bodies with wire mass, over the highest without;
wire mass lowers frequencies, except next to a violin mode."""


@dataclass(frozen=True)
class Families:
    """Families of motions that do not couple.

    Attributes
    ----------
    member : array
        Family of each degree of freedom.
    size : array
        Number of modes of each family.
    """

    member: Int[np.ndarray, " 6"]
    size: Int[np.ndarray, " family"]

    @staticmethod
    def of(mirrors: Bool[np.ndarray, " 2"], energy: Float[np.ndarray, "mode body 6"]) -> Families:
        """Find the families of a design.

        Parameters
        ----------
        mirrors : array
            Whether the design is symmetric in x and in y.
        energy : array
            Fractions of the kinetic energy of each mode, by body and degree of freedom.
        """
        signs = mirrors[:, None] * np.array([PARITY_X, PARITY_Y])
        parity = [tuple(column) for column in signs.T.tolist()]
        kinds = list(dict.fromkeys(parity))
        member = np.array([kinds.index(one) for one in parity])
        none = Families(member, np.zeros(len(kinds), dtype=int))
        return Families(member, np.bincount(none.energy(energy).argmax(1), minlength=len(kinds)))

    def energy(self, energy: Float[np.ndarray, "mode body 6"]) -> Float[np.ndarray, "mode family"]:
        """Fraction of the kinetic energy of each mode in each family."""
        return energy.sum(-2) @ np.eye(len(self.size))[self.member]

    def name(self, family: int) -> str:
        """Name a family, ``longitudinal-pitch``."""
        return "-".join(
            DOF_NAMES[dof] for dof, own in zip(DOFS, self.member, strict=True) if own == family
        )

    def ranked(self, energy: Float[np.ndarray, "mode body 6"]) -> list[Int[np.ndarray, " _"]]:
        """List the numbers of the modes of each family, ascending in frequency.

        Where imperfections mix families, each keeps its number of modes.
        """
        slots = np.repeat(np.arange(len(self.size)), self.size)
        place = pair_by_overlap(self.energy(energy)[:, slots])
        own = np.where(place >= 0, slots[place], -1)
        return [np.flatnonzero(own == family) for family in range(len(self.size))]


def has_wire_mass(model: LinearSystem) -> bool:
    """Whether wires have mass, so that modes include violin modes."""
    return any(isinstance(term, WireTerm) and term.strand.massive for term in model.terms)


def solve_modes(model: LinearSystem) -> Modes:
    """Solve for the modes of the bodies; with wire mass, those most like the modes without."""
    static = eigenmodes.solve(model.constant)
    if not has_wire_mass(model):
        return static
    found = wire_modes.solve(model, HIGHEST * float(np.nanmax(static.frequency)))
    count = 6 * len(model.body)
    mass = model.mass[6 : 6 + count, 6 : 6 + count]
    pairs = pair_by_overlap(body_overlap(static.shape, found.shape, mass))
    return found.select(np.sort(pairs[pairs >= 0]))


def follow_modes(
    text: str,
    path: dict[str, Float[np.ndarray, " step"]],
    level: str,
    nominal: Float[np.ndarray, "mode coordinate"],
    found: Modes,
    model: LinearSystem,
) -> Int[np.ndarray, " mode"]:
    """Follow the modes of a design along a path to another.

    Parameters
    ----------
    text : str
        Either design as TOML.
    path : dict of arrays
        Numbers that change, by dotted path, at steps from one design to the other.
    level : str
        Name of a model that supports builds.
    nominal : array
        Shapes at the start, as in `batch_modes.Spectrum`.
    found, model : Modes, LinearSystem
        At the end.

    Returns
    -------
    place : array
        Number among the modes at the end of each mode at the start; -1 where it is unknown.
    """
    count = len(next(iter(path.values())))
    squared, good = np.full((count, len(nominal)), np.nan), np.zeros(count, dtype=bool)
    shape = np.zeros((count, *nominal.shape))
    for batch, here in variants.balanced(text, path, level, allow_unstable=True):
        if batch.model.size - 6 == nominal.shape[1]:
            solved = batch_modes.solve(batch.model)
            squared[here], shape[here] = solved.omega_squared, solved.shape
            good[here] = batch.status == builds.GOOD
    if not good[-1]:
        return np.full(len(nominal), -1)
    rank, _ = mode_tracking.follow(squared, shape, good, (0,), nominal)
    mass = np.diag(model.basis @ model.mass @ model.basis.T)
    return pair_by_shape(shape[-1], found.shape * np.sqrt(mass[6:]))[0][rank[-1]]
