"""Geometric stiffness: what a force does when the body that it acts on turns.

A point at arm w of a body goes to t x w + t x (t x w)/2 when the body turns by a vector t.  A force that is the
gradient F of an energy with respect to the point's position therefore adds, to second order,
F . (t x (t x w))/2 to the energy, whose Hessian in t is (F w^T + w F^T)/2 - (F . w) I.
It is linear in F w^T, so those outer products are summed over all points of a body first.
(Second-order expansion of the rotation about the current pose; compare Goldstein, Classical Mechanics, section 4.8.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from suspension_cli.design.scene import Index


def add_arms(outer: Any, body: Index, force: Any, arm: Any) -> None:
    """Add F w^T of forces at points to each body's sum, in place.

    Parameters
    ----------
    outer : (..., n + 1, 3, 3) array
    body : (k,) int array
    force, arm : (..., k, 3) arrays
        N (gradient of the energy, not the force on the body) and m.
    """
    products = force[..., :, None] * arm[..., None, :]
    on = (np.arange(outer.shape[-3])[:, None] == body[None, :]).astype(float)
    flat = products.reshape(*products.shape[:-2], 9)
    outer += (on @ flat).reshape(*flat.shape[:-2], outer.shape[-3], 3, 3)


def rotation_hessian(outer: Any) -> Any:
    """Hessian (..., n + 1, 3, 3) in each body's rotation, from the summed F w^T."""
    trace = np.trace(outer, axis1=-2, axis2=-1)
    return (outer + np.swapaxes(outer, -1, -2)) / 2 - trace[..., None, None] * np.eye(3)
