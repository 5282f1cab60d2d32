"""Terms of a linear system that depend on frequency, and what the solvers ask of each.

A term adds to the stiffness a few functions of frequency times constant matrices,

    Z(omega) = K + i omega C - omega^2 M + sum over terms and n of f_n(omega) A_n,

where K is the whole static, lossless stiffness: f_n(0) is 0 without loss. It also computes its
dissipation x^H Im(f A) x in a motion x by cause, as a sum of squares in which nothing cancels.

The kinds of terms, each a class:

- `wire_term.WireTerm`: wires that bend, with their losses and, in the violin model, their mass;
- `matrix_terms.StructuralLoss`: a stiffness with a loss angle, f = i phi(omega);
- `matrix_terms.StiffnessTable`: a stiffness given as a table against frequency;
- `matrix_terms.Damper`: a viscous damper, f = i omega;
- `models.cavity.Light`: the light of a detuned cavity, a function with poles of its own.

A term whose function is a fraction of polynomials, like the last, is a `TermWithStates`: it can be
replaced by a few coordinates with constant matrices, which a state space and a search for poles
need.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

import numpy as np

from suspension_cli.elimination import ROUNDING, multiply_real

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact, Int

    from suspension_cli.linear.coordinates import AddedCoordinates

    Selection: TypeAlias = "Int[np.ndarray, ' system'] | slice | int"

LIGHT_ENDING = ".light"
"""Ending of the name of the motion of light, see `TermWithStates.motion_name`; in `Modes.wire`."""
Dissipation: TypeAlias = "dict[tuple[str, float], Float[np.ndarray, ' frequency']]"
"""Dissipation x^H Im(f A) x by cause and temperature (K)."""


class Term(ABC):
    """A part of a linear system that depends on frequency."""

    is_viscous: ClassVar[bool] = False
    """Whether it acts on motions that do not oscillate too, as dampers do."""

    @property
    @abstractmethod
    def has_complex_frequency(self) -> bool:
        """Whether its functions are those of any motion exp(s t), at omega = -i s.

        Loss angles and tables are known for oscillations alone: they are taken at Im s.
        """

    @cached_property
    def columns(self) -> Int[np.ndarray, " column"]:
        """Coordinates that it acts on."""
        raise NotImplementedError

    @cached_property
    def compact(self) -> Float[np.ndarray, "function column column"]:
        """Matrices A_n among `columns`."""
        raise NotImplementedError

    @abstractmethod
    def rounding(
        self, place: Int[np.ndarray, " column"]
    ) -> Float[np.ndarray, "*#function column column"]:
        """Largest rounding errors of the elements of `compact`, see `elimination.sizes`."""

    @abstractmethod
    def at(self, omega: Inexact[np.ndarray, " frequency"], *, lossy: bool = True) -> EvaluatedTerm:
        """Evaluate at frequencies in rad/s; a term of many builds at one each."""

    @abstractmethod
    def within(self, keep: Int[np.ndarray, " own"]) -> Any:
        """What `EvaluatedTerm.dissipated` needs of motions of some coordinates."""

    @abstractmethod
    def with_loss_angle(self, angle: float) -> Term | None:
        """The term with one loss angle (rad) in all deformations; None if it stores no energy."""

    @abstractmethod
    def spread(self, from_new: Float[np.ndarray, "coordinate new"]) -> Term:
        """Change to new coordinates: old = `from_new` @ new."""

    @abstractmethod
    def select(self, which: Selection) -> Term:
        """Select some of many builds."""


class TermWithStates(Term):
    """A term that a few coordinates of its own, with constant matrices, can replace."""

    @property
    @abstractmethod
    def motion_name(self) -> str:
        """Name of the motion of these coordinates in a list of modes: ``arm.light``."""

    @abstractmethod
    def states(self) -> AddedCoordinates:
        """Coordinates to add to the system without this term."""

    @abstractmethod
    def inertia(
        self,
        omega: Float[np.ndarray, " mode"],
        motion: Inexact[np.ndarray, "coordinate mode"],
    ) -> Float[np.ndarray, " mode"]:
        """Compute -x^H d Re(f A) / d(omega^2) x, kg m^2, which adds to the inertia x^H M x."""


class EvaluatedTerm(ABC):
    """A term at given frequencies (f,), or a term of many builds at one each."""

    @abstractmethod
    def functions(
        self, which: Int[np.ndarray, " function"]
    ) -> list[Inexact[np.ndarray, " #frequency"]]:
        """Select functions f_n by number."""

    @property
    @abstractmethod
    def stiffness(self) -> Inexact[np.ndarray, "system column column"]:
        """The sum of f_n A_n among `Term.columns`, of many builds."""

    @abstractmethod
    def dissipated(self, within: Any, motion: Inexact[np.ndarray, "own frequency"]) -> Dissipation:
        """Compute the dissipation in motions of some coordinates, those of `Term.within`."""


def quadratic_form(
    matrix: Float[np.ndarray, "coordinate coordinate"],
    motion: Inexact[np.ndarray, "coordinate frequency"],
) -> Float[np.ndarray, " frequency"]:
    """Compute x^H A x of a symmetric real matrix A and columns x; not below 0 by rounding alone.

    What a spring loses when both its ends move alike cancels.

    >>> quadratic_form(np.diag([1.0, 2.0]), np.array([[1.0], [1j]]))
    array([3.])
    """
    used = np.flatnonzero(matrix.any(0))
    own = matrix[used[:, None], used]
    x = motion[used]
    result = np.real(np.conj(x) * multiply_real(own, x)).sum(0)
    negative = np.flatnonzero(result < 0)
    if len(negative):
        size = np.abs(x[:, negative])
        terms = (size * (np.abs(own) @ size)).sum(0)
        is_rounding = result[negative] >= -ROUNDING * terms
        result[negative[is_rounding]] = 0.0
    return result
