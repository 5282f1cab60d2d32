"""Constant loss matrix that gives each mode the Q of frequency-dependent losses.

State spaces and closed loops need constant matrices. With mode shapes v of unit modal mass and the
dissipation of each at its own frequency, d = v^T Im Z(omega) v = omega^2 / Q,

    K'' = sum over modes of d (M v) (M v)^T,    so that v_m^T K'' v_n = d_m for n = m, else 0,

each resonance keeps its width. Between and far above the resonances the losses differ from the
design's.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.linear import batch_modes, eigenmodes
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Float


def with_constant_loss(model: LinearSystem) -> LinearSystem:
    """Replace terms that depend on frequency by a constant loss that gives every mode its Q.

    For a system without batch axes and without wires that have mass.
    """
    if not model.terms:
        return model
    # dampers are constant already
    undamped = replace(model, damping=np.zeros_like(model.damping))
    modes = eigenmodes.solve(undamped)
    momentum = model.mass @ batch_modes.solve(undamped).motion.T
    lossy = np.isfinite(modes.q) & (modes.omega_squared > 0)  # an unstable mode has no Q
    dissipation = np.where(lossy, modes.omega_squared / np.where(lossy, modes.q, 1.0), 0.0)
    loss = 1j * _relative_to_support((momentum * dissipation) @ momentum.T, model.rigid)
    stretched = model.stretched
    if stretched is not None:
        stretched = replace(stretched, soft=np.real(stretched.soft) + loss)
    lossy = model.stiffness + loss if dissipation.any() else None
    return replace(model, terms=(), lossy=lossy, stretched=stretched)


def _relative_to_support(
    loss: Float[np.ndarray, "coordinate coordinate"],
    rigid: Float[np.ndarray, "coordinate 6"] | None,
) -> Float[np.ndarray, "coordinate coordinate"]:
    """Project a loss matrix on motion relative to the support: rigid motion is lossless."""
    to_relative = np.eye(len(loss))
    to_relative[:, :6] = 0.0 if rigid is None else -rigid
    to_relative[:6, :6] = 0.0
    result = to_relative.T @ loss @ to_relative
    return (result + result.T) / 2
