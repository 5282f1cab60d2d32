"""The stiffness of wires against stretching, kept apart from all else, so that a nearly rigid wire takes no digits from what is soft.

Stretching a wire by its elongation e = a . x stores k (a . x)^2 / 2, so a stiffness is a soft part and a sum of k a a^T.  In one double the sum of k and
the stiffness of a blade that is 1e10 times softer keeps six digits of the blade, and eliminating the blade's tip squares that loss.  Two remedies:

- The sum is taken in twofold arithmetic, and what rounding to doubles takes from it is kept.
- The tension of a wire is made a coordinate (p, in m, of force s p): with  k e = s p  each k a a^T becomes

      ( soft   s a    )
      ( s a^T  -s^2/k )

  in which k stands as a compliance by itself.  Eliminating a tip then adds the compliances of wire and blade, and nothing cancels, however large k
  (the mixed form of the finite element method: Zienkiewicz and Taylor, The Finite Element Method, 5th ed., vol. 1, chapter 11).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.design.scene import Array, Index, Scene
from suspension_cli.mechanics import string
from suspension_cli.mechanics.blocks import Symmetry
from suspension_cli.mechanics.equilibrium import Equilibrium
from suspension_cli.mechanics.invariance import completed_forms
from suspension_cli.mechanics.pose import Layout, rigid_motion
from suspension_cli.mechanics.tangent import tangent
from suspension_cli.mechanics.twofold import Twofold

SOFT = 1e-5
"""Stiffness of a blade over that of its wires, from which on elimination in doubles leaves digits enough to refine (it loses the square of the ratio)."""
if TYPE_CHECKING:
    from suspension_cli.mechanics.model import LinearModel

ALIKE = 1e-13
"""Difference of two forms, over their largest element, that is rounding."""


@dataclass(frozen=True)
class Stretching:
    """How wires stretch.

    Attributes
    ----------
    form, low : (w, N) arrays
        Elongation of each wire with the coordinates, and what rounding takes from it.
    stiffness : (w,) array
        N/m.
    allowed : (N, N) bool array
        Elements of a matrix that a symmetry does not forbid.
    """

    form: Array
    low: Array
    stiffness: Any
    allowed: Any

    def added(self, matrix: Twofold, stiffness: Any) -> Twofold:
        """A matrix (N, N) with the sum of k a a^T of some real stiffnesses (w,) added; exactly symmetric if the matrix is."""
        form = Twofold(self.form, self.low)
        square = form[:, :, None] * form[:, None, :]
        taken = (square * Twofold.of(np.broadcast_to(np.reshape(stiffness, (-1, 1, 1)), square.high.shape))).summed()
        upper = np.triu(self.allowed)
        high, low = (np.where(upper, part, 0.0) for part in (taken.high, taken.low))
        return matrix + Twofold(*(part + np.triu(part, 1).T for part in (high, low)))

    def spread(self, from_new: Any) -> Stretching:
        """The same for new coordinates, from which the old ones follow as `from_new` (N, N') @ new."""
        reach = (from_new != 0).astype(float)
        return replace(self, form=self.form @ from_new, low=self.low @ from_new, allowed=reach.T @ self.allowed @ reach > 0)


def apart(scene: Scene, numbering: Layout, balanced: Equilibrium, adapted: Symmetry) -> tuple[Array, Stretching]:
    """The tangent stiffness (N, N) of a scene without batch axes but for the stretching of its wires, and that; in adapted coordinates."""
    wires = scene.wires
    now = string.state(scene, balanced.pose)
    slack = replace(wires, tension=now.tension, stiffness=np.zeros_like(now.tension))
    form = (string.span_jacobian(scene, numbering, balanced.pose, now) * now.direction).sum(-1).T
    low = completed_forms(form, rigid_motion(numbering.size, scene.bodies.position + balanced.pose.shift), wires.lower)
    soft = tangent(replace(scene, wires=slack), numbering, balanced.pose)[1]
    return adapted.apply(soft), Stretching(form @ adapted.basis, low @ adapted.basis, wires.stiffness, adapted.allowed)


def held(model: LinearModel, block: Index, tips: Any) -> Array | None:
    """The support's and a block's coordinates (rows) from others in which some `tips` (c,) of blades are counted from where their wires would hold them.

    Relative to its blade a tip that hangs on a stiff wire moves as the body below does, and the wire's stiffness stands in all elements between them;
    counted from there it stands in that of the tip alone.  None if no wire so stiff hangs on these tips, or it is not known how wires stretch.
    """
    if model.stretched is None or not tips.any():
        return None
    both, of = np.concatenate([np.arange(6), block]), model.stretched
    form, at = of.form[:, both], 6 + np.flatnonzero(tips)
    allowed = of.allowed[np.ix_(block[tips], both)]
    pull = np.where(allowed, (form[:, at].T * of.stiffness) @ form, 0.0)
    own, wire = np.diag(model.stiffness)[block[tips]], pull[np.arange(len(at)), at]
    if (own - wire >= SOFT * wire).all():
        return None
    result = np.eye(len(both))
    result[at] = -np.linalg.lstsq(pull[:, at], pull, rcond=None)[0]
    result[np.ix_(at, at)] = np.eye(len(at))
    return result


def distinct(forms: Array) -> tuple[Array, Any]:
    """Forms (w, N) that differ by more than their sign and are not 0, and for each of them the wires that have it."""
    size = np.abs(forms).max(1, initial=0.0)
    rows: list[Array] = []
    members: list[list[int]] = []
    for n in np.flatnonzero(size > 0).tolist():
        form, near = forms[n], ALIKE * size[n]
        same = next((m for m, row in enumerate(rows) if min(np.abs(row - form).max(), np.abs(row + form).max()) <= near), None)
        if same is None:
            rows.append(form)
            members.append([n])
        else:
            members[same].append(n)
    return np.array(rows).reshape(-1, forms.shape[1]), members
