"""A model with constant matrices in place of losses that depend on frequency: every mode keeps its own.

State spaces and closed loops need constant matrices.  With the shapes v of all modes, of unit modal mass, and what each loses at its own frequency,
d = v^T Im Z(omega) v = omega^2 / Q,

    K'' = sum over modes of d (M v) (M v)^T,    so that v_m^T K'' v_n = d_m for n = m, else 0:

every resonance is as sharp as it was.  Between resonances, and far above them, losses are not those of the design.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from suspension_cli.analysis import modes
from suspension_cli.mechanics.model import LinearModel


def rational(model: LinearModel) -> LinearModel:
    """A model without terms that depend on frequency, whose modes have the Q that they have with them.

    Parameters
    ----------
    model : LinearModel
        Without batch axes, and without wires that have mass.

    Returns
    -------
    LinearModel
        The model itself if nothing in it depends on frequency.
    """
    if not model.terms:
        return model
    found = modes.solve(replace(model, damping=np.zeros_like(model.damping)))  # dampers stay what they are
    own = np.linalg.solve(model.basis, np.pad(found.shape, ((0, 0), (6, 0))).T)
    member = model.member[:, None] == found.block
    pull = model.mass @ np.where(member, own, 0.0)
    lossy = np.isfinite(found.q) & (found.omega_squared > 0)  # a mode that grows has no Q
    lost = np.where(lossy, found.omega_squared / np.where(lossy, found.q, 1.0), 0.0)
    loss = (pull * lost) @ pull.T
    return replace(model, terms=(), lossy=model.stiffness + 1j * _carried(loss, model.rigid) if lost.any() else None)


def _carried(loss: Any, rigid: Any) -> Any:
    """A loss (N, N) as that of motion relative to the support: moving everything with it costs nothing."""
    relative = np.eye(len(loss))
    relative[:, :6] = 0.0 if rigid is None else -rigid
    relative[:6, :6] = 0.0
    result = relative.T @ loss @ relative
    return (result + result.T) / 2
