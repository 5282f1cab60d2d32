"""Stretching stiffness of wires, kept separate so that stiff wires cost soft parts no digits.

An elongation e = a . x of a wire stores k (a . x)^2 / 2, so a stiffness is a soft part plus a sum
of k a a^T. In one double the sum of k and of a blade's stiffness 1e10 times smaller keeps six
digits of the latter, and eliminating the blade's tip squares that loss. In responses (`pencil`) and
modes (`batch_modes`) k enters as a compliance, to which that of a blade is added.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact, Int

ALIKE = 1e-13
"""Relative difference of two linear forms that counts as rounding."""


@dataclass(frozen=True)
class Stretching:
    """Elongations and stiffnesses of wires, of one design or many builds.

    Attributes
    ----------
    form
        Elongation of each wire per coordinate.
    stiffness
        N/m; complex if lossy.
    allowed
        Elements of a matrix that the symmetry allows.
    soft
        The stiffness without the stretching; complex if lossy.
    """

    form: Float[np.ndarray, "*batch wire coordinate"]
    stiffness: Inexact[np.ndarray, "*#batch wire"]
    allowed: Bool[np.ndarray, "coordinate coordinate"]
    soft: Inexact[np.ndarray, "*batch coordinate coordinate"]

    @property
    def whole(self) -> Inexact[np.ndarray, "*batch coordinate coordinate"]:
        """The stiffness, exactly symmetric."""
        pulled = np.swapaxes(self.form, -1, -2) * self.stiffness[..., None, :]
        stretching = np.where(self.allowed, pulled @ self.form, 0.0)
        return self.soft + (stretching + np.swapaxes(stretching, -1, -2)) / 2

    def select(self, which: Int[np.ndarray, " system"] | slice) -> Stretching:
        """Select some of many builds."""
        k = self.stiffness if self.stiffness.ndim < 2 else self.stiffness[which]
        return replace(self, form=self.form[which], stiffness=k, soft=self.soft[which])

    def spread(self, from_new: Float[np.ndarray, "coordinate new"]) -> Stretching:
        """Change to new coordinates: old = `from_new` @ new."""
        reach = (from_new != 0).astype(float)
        return replace(
            self,
            form=self.form @ from_new,
            allowed=reach.T @ self.allowed @ reach > 0,
        )


def distinct(
    forms: Float[np.ndarray, "wire coordinate"],
) -> tuple[Float[np.ndarray, "row coordinate"], list[list[int]]]:
    """Find the non-zero forms that differ by more than sign, and the wires of each."""
    size = np.abs(forms).max(1, initial=0.0)
    rows: list[Array] = []
    members: list[list[int]] = []
    for n in np.flatnonzero(size > 0).tolist():
        form, tolerance = forms[n], ALIKE * size[n]
        known = next(
            (
                m
                for m, row in enumerate(rows)
                if min(np.abs(row - form).max(), np.abs(row + form).max()) <= tolerance
            ),
            None,
        )
        if known is None:
            rows.append(form)
            members.append([n])
        else:
            members[known].append(n)
    return np.array(rows).reshape(-1, forms.shape[1]), members
