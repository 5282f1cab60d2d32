"""Terms with one function of frequency times one matrix: losses, tables and dampers.

>>> spring = np.diag([0.0, 100.0])
>>> loss = StructuralLoss("test.springs", 290.0, spring, lambda omega: 1e-3 * np.ones_like(omega))
>>> loss.at(np.array([1.0, 2.0])).functions(np.array([0]))
[array([0.+0.001j, 0.+0.001j])]
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from suspension_cli.elimination import rounding
from suspension_cli.linear.terms import EvaluatedTerm, Term, quadratic_form

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact, Int

    from suspension_cli.linear.terms import Dissipation, Selection

    Function = Callable[[Inexact[np.ndarray, " frequency"]], Inexact[np.ndarray, " frequency"]]


@dataclass(frozen=True)
class MatrixTerm(Term):
    """A function of frequency times a matrix.

    Attributes
    ----------
    cause
        What dissipates: ``test.springs``, ``test.gas``.
    temperature
        K.
    matrix
        A_1, one matrix or those of many builds.
    """

    cause: str
    temperature: float
    matrix: Float[np.ndarray, "*#batch coordinate coordinate"]

    @property
    def has_complex_frequency(self) -> bool:
        """Whether its function is that of any motion exp(s t): that of a damper is."""
        return self.is_viscous

    @cached_property
    def columns(self) -> Int[np.ndarray, " column"]:
        """Coordinates that it acts on."""
        builds = tuple(range(self.matrix.ndim - 1))
        return np.flatnonzero(self.matrix.any(builds))

    @cached_property
    def compact(self) -> Float[np.ndarray, "_ column column"]:
        """The matrix among `columns`, as a stack of one, or of those of many builds."""
        own = self.matrix[..., self.columns[:, None], self.columns]
        return own if own.ndim > 2 else own[None]

    def rounding(self, place: Int[np.ndarray, " column"]) -> Float[np.ndarray, "column column"]:
        """Largest rounding errors of the elements of `compact`."""
        return rounding(self.compact[0], place)

    def at(
        self, omega: Inexact[np.ndarray, " frequency"], *, lossy: bool = True
    ) -> EvaluatedMatrix:
        """Evaluate at frequencies in rad/s; f_1 is i times the lag, real if not `lossy`."""
        if not lossy:
            none = np.zeros(omega.shape)
            return EvaluatedMatrix(self, none, none)
        lag = self._lag(omega)
        return EvaluatedMatrix(self, lag, 1j * lag)

    @abstractmethod
    def _lag(self, omega: Inexact[np.ndarray, " frequency"]) -> Inexact[np.ndarray, " frequency"]:
        """What dissipates, at frequencies in rad/s: the loss angle of a stiffness."""

    def within(self, keep: Int[np.ndarray, " own"]) -> Float[np.ndarray, "own own"]:
        """The matrix among some coordinates."""
        return self.matrix[np.ix_(keep, keep)]

    def with_loss_angle(self, angle: float) -> Term | None:
        """None: no energy is stored."""
        del angle

    def spread(self, from_new: Float[np.ndarray, "coordinate new"]) -> Self:
        """Change to new coordinates."""
        return replace(self, matrix=from_new.T @ self.matrix @ from_new)

    def select(self, which: Selection) -> Self:
        """Select some of many builds."""
        if self.matrix.ndim == 2:
            return self
        return replace(self, matrix=self.matrix[which])


@dataclass(frozen=True)
class StructuralLoss(MatrixTerm):
    """Loss of a constant stiffness K (N/m), its `matrix`: f = i phi(omega), with phi the `angle`.

    Loss angles are phase lags of an oscillation.
    """

    angle: Function

    def _lag(self, omega: Inexact[np.ndarray, " frequency"]) -> Inexact[np.ndarray, " frequency"]:
        """Compute the loss angle at frequencies in rad/s, their real parts."""
        return self.angle(np.real(omega))

    def stored(self, omega: Float[np.ndarray, " frequency"]) -> Float[np.ndarray, " frequency"]:
        """Relative change of Re K from its static value at frequencies in rad/s: none."""
        return np.zeros_like(omega)

    def with_loss_angle(self, angle: float) -> Self:
        """The term with a constant loss angle, rad."""
        return replace(self, angle=lambda omega: np.full(np.shape(omega), angle))


@dataclass(frozen=True)
class StiffnessTable(StructuralLoss):
    """A stiffness that changes with frequency: f = storage(omega) + i phi(omega).

    Its static value is in the matrices of the system. `storage` is the relative change of Re K from
    it, so it is 0 at rest.
    """

    storage: Function

    def at(
        self, omega: Inexact[np.ndarray, " frequency"], *, lossy: bool = True
    ) -> EvaluatedMatrix:
        """Evaluate at frequencies in rad/s, their real parts."""
        loss = super().at(omega, lossy=lossy)
        return replace(loss, value=loss.value + self.storage(np.real(omega)))

    def stored(self, omega: Float[np.ndarray, " frequency"]) -> Float[np.ndarray, " frequency"]:
        """Relative change of Re K from its static value at frequencies in rad/s."""
        return self.storage(omega)


@dataclass(frozen=True)
class Damper(MatrixTerm):
    """A viscous damper C (N s/m), its `matrix`: f = i omega."""

    is_viscous: ClassVar[bool] = True

    def _lag(self, omega: Inexact[np.ndarray, " frequency"]) -> Inexact[np.ndarray, " frequency"]:
        """Give omega itself, rad/s, which may be complex."""
        return omega


@dataclass(frozen=True)
class EvaluatedMatrix(EvaluatedTerm):
    """A `MatrixTerm` at given frequencies: the value of f_1, and the `lag` that dissipates.

    The dissipation is Re(lag) x^H A x.
    """

    term: MatrixTerm
    lag: Inexact[np.ndarray, " frequency"]
    value: Inexact[np.ndarray, " frequency"]

    def functions(
        self, which: Int[np.ndarray, " function"]
    ) -> list[Inexact[np.ndarray, " frequency"]]:
        """Select functions f_n by number."""
        return [self.value] * len(which)

    @property
    def stiffness(self) -> Inexact[np.ndarray, "system column column"]:
        """The function times the matrix, among `MatrixTerm.columns`."""
        return self.value[:, None, None] * self.term.compact

    def dissipated(self, within: Any, motion: Inexact[np.ndarray, "own frequency"]) -> Dissipation:
        """Compute the dissipation x^H Im(f A) x, with the matrix of `MatrixTerm.within`."""
        key = self.term.cause, self.term.temperature
        return {key: np.real(self.lag) * quadratic_form(within, motion)}
