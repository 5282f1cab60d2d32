"""Least squares for sensing and driving matrices, the modes and the delay (see `matrix_fit`)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.fit.osem_data import OsemData
from suspension_cli.analyses.fit.problem import stack_parts
from suspension_cli.analyses.fit.stage_responses import ChangedModes, StageResponses
from suspension_cli.conventions import DOFS
from suspension_cli.physics import local_control
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float

SCALE_SIGMA = 0.3
"""Prior standard deviation of K, around 1: of what all sensors of a motion share."""
DAMPING_SIGMA = 0.1
"""The same of their added 1/Q."""


@dataclass(frozen=True)
class MatrixProblem:
    """Least squares for A, B, the modes and the delay.

    Unknowns are, in this order: what the columns of A have beside the nominal ones and orthogonal
    to the rows of the nominal sensing matrix (motion, number), and the elements of B (motion,
    coil), over the scales of the motions; K - 1; the changes e of the stiffness and the added
    dampings of the modes; the delay in units of the inverse of the highest omega. Elements of
    motions that the OSEMs do not resolve are nominal. `sign` is that of each sensor,
    `stiffness_sigma` the prior standard deviation of each change e.
    """

    data: OsemData
    responses: StageResponses
    sign: Float[np.ndarray, " sensor"]
    stiffness_sigma: Float[np.ndarray, " change"]

    @cached_property
    def nominal(self) -> tuple[Float[np.ndarray, "sensor 6"], Float[np.ndarray, "6 coil"]]:
        """A and B of the design, with the signs of the sensors."""
        return (
            self.sign[:, None] * local_control.sensing_rows(self.data.sensors),
            local_control.driving_rows(self.data.coils).T,
        )

    @cached_property
    def resolved(self) -> Bool[np.ndarray, " 6"]:
        """Whether sensors and coils resolve each motion."""
        a, b = self.nominal
        _, read = local_control.compute_weights(np.eye(6), a)
        _, pushed = local_control.compute_weights(np.eye(6), b.T)
        return read & pushed

    @property
    def motion(self) -> tuple[str, ...]:
        """Names of the motions that are resolved."""
        return tuple(dof for dof, one in zip(DOFS, self.resolved, strict=True) if one)

    @cached_property
    def size(self) -> tuple[Float[np.ndarray, " motion"], Float[np.ndarray, " motion"]]:
        """Norms of the nominal columns of A and rows of B: scales of their elements."""
        a, b = self.nominal
        return np.linalg.norm(a, axis=0)[self.resolved], np.linalg.norm(b, axis=1)[self.resolved]

    @cached_property
    def parts(self) -> tuple[slice, slice, slice, slice, slice, int]:
        """Places of A, B, K, changes of frequencies, dampings, and the delay in z."""
        motions = len(self.motion)
        counts = {
            "a": motions * (len(self.data.sensors) - 1),
            "b": motions * len(self.data.coils),
            "scale": motions,
            "change": len(self.responses.first),
            "damping": len(self.responses.mode_omega),
        }
        ends = [0, *np.cumsum(list(counts.values())).tolist()]
        of_a, of_b, of_scale, of_change, of_damping = (slice(*pair) for pair in pairwise(ends))
        return of_a, of_b, of_scale, of_change, of_damping, ends[-1]

    @cached_property
    def free_columns(self) -> Float[np.ndarray, "motion sensor number"]:
        """Orthonormal changes of each column of A that the nominal sensing matrix does not read."""
        from scipy import linalg

        return np.array([linalg.null_space(row[None]) for row in self.nominal_sensing])

    @cached_property
    def nominal_sensing(self) -> Float[np.ndarray, "motion sensor"]:
        """The sensing matrix of the design, with the signs of the sensors."""
        return local_control.compute_weights(np.eye(6), self.nominal[0])[0][self.resolved]

    @cached_property
    def nominal_driving(self) -> Float[np.ndarray, "coil motion"]:
        """The driving matrix of the design."""
        return local_control.compute_weights(np.eye(6), self.nominal[1].T)[0][self.resolved].T

    def pack(self, a: Array, b: Array) -> Array:
        """Turn A and B into unknowns with modes of the design, without delay.

        The scale of each motion becomes that of the convention.
        """
        z = np.zeros(self.parts[-1] + 1)
        own = self.resolved
        scale = self.scales(a)
        columns = (a[:, own] / scale - self.nominal[0][:, own]) / self.size[0]
        z[self.parts[0]] = np.einsum("ksn,sk->kn", self.free_columns, columns).ravel()
        z[self.parts[1]] = (b[own] * (scale / self.size[1])[:, None]).ravel()
        z[self.parts[2]] = scale - 1
        return z

    def scales(self, a: Array) -> Float[np.ndarray, " motion"]:
        """Scale at which the nominal sensing matrix reads each motion of sensors A."""
        return np.einsum("ks,sk->k", self.nominal_sensing, a[:, self.resolved])

    def signs(self, a: Array) -> Float[np.ndarray, " sensor"]:
        """Sign of each sensor of A against the design."""
        own = self.resolved
        along = (a[:, own] * self.nominal[0][:, own] / self.size[0] ** 2).sum(1)
        return np.where(along < 0, -1.0, 1.0)

    def matrices(
        self, z: Array
    ) -> tuple[Float[np.ndarray, "sensor 6"], Float[np.ndarray, "6 coil"]]:
        """A and B of unknowns."""
        a, b = (part.copy() for part in self.nominal)
        own = len(self.motion)
        moved = np.einsum("ksn,kn->sk", self.free_columns, z[self.parts[0]].reshape(own, -1))
        a[:, self.resolved] += moved * self.size[0]
        b[self.resolved] = z[self.parts[1]].reshape(own, -1) * self.size[1][:, None]
        return a, b

    def inverses(self, z: Array) -> tuple[Array, Array]:
        """S and D."""
        a, b = self.matrices(z)
        sensing, _ = local_control.compute_weights(np.eye(6)[self.resolved], a)
        driving, _ = local_control.compute_weights(np.eye(6)[self.resolved], b.T)
        return sensing, driving.T

    def elements(self, z: Array) -> Float[np.ndarray, " element"]:
        """Elements of S and D."""
        return np.concatenate([part.ravel() for part in self.inverses(z)])

    @property
    def prior(self) -> Float[np.ndarray, " unknown"]:
        """Inverse standard deviations of the priors; 0 without."""
        _, _, scale, change, damping, delay = self.parts
        weight = np.zeros(delay + 1)
        weight[scale] = 1 / SCALE_SIGMA
        weight[change] = 1 / self.stiffness_sigma
        weight[damping] = 1 / DAMPING_SIGMA
        return weight

    def changed(self, z: Array) -> ChangedModes:
        """Responses of the stage with the modes and the relative scales of unknowns."""
        scale = np.ones(6)
        scale[self.resolved] += z[self.parts[2]]
        return self.responses.at(z[self.parts[3]], z[self.parts[4]]).scaled(scale)

    def delayed(self, z: Array) -> Complex[np.ndarray, "frequency 1 1"]:
        """Factor of the delay."""
        omega = self.responses.omega
        return np.exp(-1j * omega / omega.max() * z[-1])[:, None, None]

    def predict(self, z: Array) -> Complex[np.ndarray, "frequency sensor coil"]:
        """Compute the functions of unknowns."""
        a, b = self.matrices(z)
        return self.delayed(z) * (a @ self.changed(z).stage @ b)

    def differentiate(self, z: Array) -> Complex[np.ndarray, "unknown frequency sensor coil"]:
        """Differentiate `predict`."""
        a, b = self.matrices(z)
        now = self.changed(z)
        late = self.delayed(z)
        own = self.resolved
        pushed = late * (now.stage @ b)  # motions per drive
        read = late * (a @ now.stage)  # readings per force along each motion
        result = np.zeros((len(z), *self.data.value.shape), dtype=complex)
        moved = self.free_columns * self.size[0][:, None, None]
        by_a = np.einsum("ksn,fkc->knfsc", moved, pushed[:, own])
        result[self.parts[0]] = by_a.reshape(-1, *self.data.value.shape)
        by_b = result[self.parts[1]].reshape(len(self.motion), -1, *self.data.value.shape)
        for n in range(by_b.shape[1]):
            by_b[:, n, :, :, n] = self.size[1][:, None, None] * read[:, :, own].transpose(2, 0, 1)
        read_modes = late * (a @ now.from_modes)
        pushed_modes = now.to_modes @ b
        through = np.einsum("fsj,fkc->jkfsc", read_modes, pushed_modes)
        w = self.responses.mode_omega
        one, other = self.responses.first, self.responses.second
        both = through[one, other] + through[other, one]
        both[one == other] /= 2
        result[self.parts[3]] = -(w[one] * w[other])[:, None, None, None] * both
        lossy = 1j * self.responses.omega[:, None, None] * w[:, None, None, None]
        modes = np.arange(len(w))
        result[self.parts[4]] = -lossy * through[modes, modes]
        # K G K^-1: a row more, a column less
        by_row = np.einsum("sk,fkc->kfsc", a[:, own], pushed[:, own])
        by_column = np.einsum("fsk,kc->kfsc", read[:, :, own], b[own])
        scale = (1 + z[self.parts[2]])[:, None, None, None]
        result[self.parts[2]] = (by_row - by_column) / scale
        omega = self.responses.omega
        turn = (-1j * omega / omega.max())[:, None, None]
        result[-1] = turn * late * (a @ now.stage @ b)
        return result

    def residual(self, z: Array, sigma: Array) -> Float[np.ndarray, " residual"]:
        """Residuals of data and priors over their standard deviations."""
        off = ((self.predict(z) - self.data.value) / sigma).ravel()
        weight = self.prior
        return np.concatenate([stack_parts(off), (weight * z)[weight > 0]])

    def jacobian(self, z: Array, sigma: Array) -> Float[np.ndarray, "residual unknown"]:
        """Differentiate `residual`."""
        slopes = (self.differentiate(z) / sigma).reshape(len(z), -1).T
        weight = self.prior
        return np.concatenate([stack_parts(slopes), np.diag(weight)[weight > 0]])

    def widened(self, z: Array, fraction: float) -> Float[np.ndarray, "frequency sensor coil"]:
        """Standard deviations of the data with that of the modes, times a fraction."""
        if not fraction:
            return self.data.sigma
        slopes = self.differentiate(z)
        _, _, _, change, damping, _ = self.parts
        power = np.einsum("k,kfsc->fsc", self.stiffness_sigma**2, np.abs(slopes[change]) ** 2)
        power = power + DAMPING_SIGMA**2 * (np.abs(slopes[damping]) ** 2).sum(0)
        return np.sqrt(self.data.sigma**2 + fraction**2 * power)
