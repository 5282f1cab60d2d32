"""Linear system of small motions: the result of every model, the input of every analysis.

An elongation e = a . x of a wire stores k (a . x)^2 / 2, so a stiffness is a soft part plus a sum
of k a a^T. In one double the sum of k and of a blade's stiffness 1e10 times smaller keeps six
digits of the latter, and eliminating the blade's tip squares that loss. So a system keeps soft
part, elongations and k. In responses (`pencil`) and modes (`batch_modes`) k enters as a compliance,
to which that of a blade is added.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.conventions import DOFS
from suspension_cli.linear.coordinates import AddedCoordinates
from suspension_cli.linear.terms import Term, TermWithStates
from suspension_cli.linear.wire_term import EvaluatedWires

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact, Int


@dataclass(frozen=True)
class Ground:
    """Forces -(K + i omega C + sum f_n A_n) g of the motion g of the ground on the coordinates.

    K (complex if lossy) and C are 0 in the rows of the support. The `terms` replace the first terms
    of the system, with the ground's coordinates for the support's.
    """

    stiffness: Inexact[np.ndarray, "*#batch coordinate 6"]
    damping: Inexact[np.ndarray, "*#batch coordinate 6"]
    terms: tuple[Term, ...] = ()

    def widened(self, count: int) -> Ground:
        """Append coordinates on which the ground exerts no force."""
        size = self.stiffness.shape[-2]
        terms = tuple(term.spread(np.eye(size, size + count)) for term in self.terms)
        return Ground(_padded(self.stiffness, count), _padded(self.damping, count), terms)


def _padded(matrix: Inexact[np.ndarray, "*batch row column"], count: int) -> Any:
    """Append rows of zeros."""
    return np.pad(matrix, [(0, 0)] * (matrix.ndim - 2) + [(0, count), (0, 0)])


@dataclass(frozen=True)
class LinearSystem:
    """Linear equations of motion M x'' + C x' + K x = f, the support's coordinates included.

    The coordinates are, in this order: six of the support, six of each body, then those of blade
    tips. Tips may be combined (sum and difference of two blades that are mirror images), so that
    motions of different symmetry share no matrix element; coordinates of bodies are never combined.

    Attributes
    ----------
    coordinate
        ``support.x``, ..., ``test.yaw``, ``test.blade1.z``.
    unit, momentum_unit
        SI unit of each coordinate (m, rad, or what an added one has) and of its momentum.
    basis
        The named coordinates (rows) in terms of the system's own (columns).
    massless
        Whether each coordinate has no inertia (blade tips without tip mass).
    mass, damping
        SI; exactly symmetric; exactly 0 where a symmetry forbids a coupling.
    soft
        The stiffness if wires kept their lengths, likewise; complex, k (1 + i phi), if lossy.
    elongation
        Elongation of each wire per coordinate; none where the stretching is part of `soft`.
    k
        Stiffness of each wire against stretching, N/m; complex if lossy.
    allowed
        Elements of a matrix of wires that the symmetry allows.
    orientation
        Rotation of each body (support first) from its nominal orientation; None if none is rotated.
    residual
        Largest unbalanced force in the equilibrium, as a fraction of the weight.
    rigid
        Coordinates per unit motion of the support (m, rad) when everything moves with it as one
        body; 0 for coordinates relative to a body (blade tips, the frame). None if not known.
    ground
        Forces of the motion of the ground beside the support; None if nothing is attached to it.
        The ground is at rest in all matrices.
    active
        Whether springs, links or dampers may give power to the motion. Else all losses are
        positive, and a negative one is a rounding error.
    top
        Number (from 0) of the body that hangs from the support in the chain of each body; () if
        that is the first body for all.
    unowned
        Numbers of added coordinates that belong to no body, whatever their names are.
    """

    body: tuple[str, ...]
    coordinate: tuple[str, ...]
    unit: tuple[str, ...]
    momentum_unit: tuple[str, ...]
    basis: Float[np.ndarray, "coordinate coordinate"]
    massless: Bool[np.ndarray, " coordinate"]
    mass: Inexact[np.ndarray, "*#batch coordinate coordinate"]
    damping: Inexact[np.ndarray, "*#batch coordinate coordinate"]
    soft: Inexact[np.ndarray, "*#batch coordinate coordinate"]
    elongation: Inexact[np.ndarray, "*#batch wire coordinate"]
    k: Inexact[np.ndarray, "*#batch wire"]
    allowed: Bool[np.ndarray, "coordinate coordinate"]
    orientation: Inexact[np.ndarray, "*#batch _ 3 3"] | None = None
    residual: float = 0.0
    wire: tuple[str, ...] = ()
    terms: tuple[Term, ...] = ()
    rigid: Float[np.ndarray, "*#batch coordinate 6"] | None = None
    ground: Ground | None = None
    active: bool = False
    top: tuple[int, ...] = ()
    unowned: tuple[int, ...] = ()

    @property
    def driven_by_ground(self) -> LinearSystem:
        """System with the motion of the ground in place of that of the support."""
        ground = self.ground
        assert ground is not None
        at_rest = np.diag(np.arange(self.size) >= 6).astype(float)
        moved = []
        for columns in (ground.stiffness, ground.damping):
            whole = np.zeros((*columns.shape[:-1], self.size), columns.dtype)
            whole[..., :6] += columns
            whole[..., :6, :] += np.swapaxes(columns, -1, -2)
            moved.append(whole)
        rest = replace(self, terms=self.terms[len(ground.terms) :], rigid=None, ground=None)
        stiffness, damping = moved
        driven = rest.spread(at_rest, 0.0, stiffness, damping)
        return replace(driven, terms=(*ground.terms, *driven.terms), allowed=self.allowed)

    def spread(
        self,
        from_new: Float[np.ndarray, "coordinate new"],
        mass: Inexact[np.ndarray, "*#batch new new"] | float,
        stiffness: Inexact[np.ndarray, "*#batch new new"],
        damping: Inexact[np.ndarray, "*#batch new new"],
    ) -> LinearSystem:
        """Change matrices to new coordinates, old = `from_new` @ new, and add some to them."""

        def change(matrix: np.ndarray) -> np.ndarray:
            return from_new.T @ matrix @ from_new

        reach = (from_new != 0).astype(float)
        return replace(
            self,
            mass=change(self.mass) + mass,
            damping=change(self.damping) + damping,
            soft=change(self.soft) + stiffness,
            elongation=self.elongation @ from_new,
            terms=tuple(term.spread(from_new) for term in self.terms),
            allowed=reach.T @ self.allowed @ reach > 0,
        )

    def widened(
        self,
        added: AddedCoordinates,
        from_new: Float[np.ndarray, "coordinate new"] | None = None,
    ) -> LinearSystem:
        """Append coordinates, which move those so far by `from_new` (default: not at all)."""
        size = self.size
        wider_size = size + added.count
        basis = np.eye(wider_size)
        basis[:size, :size] = self.basis
        old = np.eye(size, wider_size) if from_new is None else from_new
        wider = self.spread(old, added.mass, added.stiffness, added.damping)
        builds = tuple(range(added.mass.ndim - 2))
        has_mass = (added.mass != 0).any(builds)
        coupled = has_mass | (added.stiffness != 0) | (added.damping != 0)
        massless = np.append(self.massless, np.ones(added.count, dtype=bool))
        unowned = self.unowned
        if not added.belong_to_bodies:
            unowned = (*unowned, *range(size, wider_size))
        return replace(
            wider,
            coordinate=(*self.coordinate, *added.name),
            unit=(*self.unit, *added.unit),
            momentum_unit=(*self.momentum_unit, *added.momentum_unit),
            basis=basis,
            massless=massless & ~has_mass.any(1),
            allowed=wider.allowed | coupled,
            ground=self.ground and self.ground.widened(added.count),
            rigid=None if self.rigid is None else _padded(self.rigid, added.count),
            unowned=unowned,
        )

    @property
    def terms_with_states(self) -> tuple[TermWithStates, ...]:
        """The terms that coordinates of their own can replace."""
        return tuple(term for term in self.terms if isinstance(term, TermWithStates))

    @property
    def constant(self) -> LinearSystem:
        """System without its terms in frequency."""
        return replace(self, terms=()) if self.terms else self

    def select(self, which: Int[np.ndarray, " system"] | slice | int) -> LinearSystem:
        """Select some of many builds, any more than once; by number, one without its axis."""

        def take(array: Any, axes: int = 2) -> Any:
            return array if array is None or np.ndim(array) == axes else array[which]

        return replace(
            self,
            mass=take(self.mass),
            damping=take(self.damping),
            soft=take(self.soft),
            elongation=take(self.elongation),
            k=take(self.k, 1),
            orientation=take(self.orientation, 3),
            terms=tuple(term.select(which) for term in self.terms),
            rigid=take(self.rigid),
            ground=None,
        )

    def at(self, omega: Float[np.ndarray, " system"]) -> LinearSystem:
        """System whose stiffness is that with all terms, at frequencies in rad/s.

        Of many builds, one frequency each.
        """
        if not self.terms:
            return self
        count = len(omega)
        soft = np.empty((self.size, self.size, count), dtype=complex)  # builds last in memory
        soft[...] = np.moveaxis(np.atleast_3d(self.soft.T).T, 0, -1)
        k = np.empty((count, self.k.shape[-1]), dtype=complex)
        k[...] = self.k
        for term in self.terms:
            here = term.at(omega)
            at = term.columns[:, None], term.columns
            own = np.moveaxis(here.stiffness, 0, -1)
            allowed = self.allowed[at]
            soft[at] += own if allowed.all() else allowed[..., None] * own
            if isinstance(here, EvaluatedWires):
                k[:, here.term.number] = np.atleast_2d(1 / here.compliance).T
        return replace(self, terms=(), soft=np.moveaxis(soft, -1, 0), k=k)

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return len(self.coordinate)

    @cached_property
    def stiffness(self) -> Inexact[np.ndarray, "*batch coordinate coordinate"]:
        """Whole static stiffness without loss, exactly symmetric, without the terms."""
        return self._sum(np.real(self.soft), np.real(self.k))

    @cached_property
    def complete(self) -> Inexact[np.ndarray, "*batch coordinate coordinate"]:
        """Whole stiffness, complex if lossy, without the terms."""
        return self._sum(self.soft, self.k) if self.is_lossy else self.stiffness

    @property
    def is_lossy(self) -> bool:
        """Whether the stiffness without the terms has loss angles."""
        return np.iscomplexobj(self.soft) or np.iscomplexobj(self.k)

    @property
    def loss(self) -> Float[np.ndarray, "*batch coordinate coordinate"]:
        """Imaginary part of the whole stiffness without the terms."""
        return np.imag(self.complete)

    @property
    def lossless(self) -> LinearSystem:
        """System without loss angles and without terms in frequency; dampers act."""
        return replace(self, terms=(), soft=np.real(self.soft), k=np.real(self.k))

    def _sum(
        self,
        soft: Inexact[np.ndarray, "*#batch coordinate coordinate"],
        k: Inexact[np.ndarray, "*#batch wire"],
    ) -> Inexact[np.ndarray, "*batch coordinate coordinate"]:
        """Add the stretching of wires, where it is allowed, to the soft stiffness."""
        if not k.shape[-1]:
            return soft
        pulled = np.swapaxes(self.elongation, -1, -2) * k[..., None, :]
        stretching = pulled @ self.elongation
        if not self.allowed.all():
            stretching = np.where(self.allowed, stretching, 0.0)
        return soft + (stretching + np.swapaxes(stretching, -1, -2)) / 2

    @cached_property
    def owner(self) -> Int[np.ndarray, " coordinate"]:
        """Number of the body of each coordinate, from 1; 0: the support and its structure.

        A blade's tip goes with the stage below.
        """
        number = {name: n for n, name in enumerate(self.body, 1)}
        own = np.array([number.get(name.split(".", 1)[0], 0) for name in self.coordinate])
        own[list(self.unowned)] = 0
        return own

    @property
    def batch(self) -> tuple[int, ...]:
        """Shape of the batch axes."""
        return np.broadcast_shapes(self.mass.shape[:-2], self.soft.shape[:-2])

    def index(self, body: str, dof: str) -> int:
        """Return the number of a coordinate of a body."""
        return 6 * (self.body.index(body) + 1) + DOFS.index(dof)
