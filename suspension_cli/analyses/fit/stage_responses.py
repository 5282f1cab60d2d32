"""Responses of the motions of a stage to forces on it, with changed modes of its suspension."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.linear import response
from suspension_cli.linear.signals import Signal, linear_form
from suspension_cli.studies.response_matrix import Plant

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Int

STIFFNESS_SIGMA = 0.2
"""Prior standard deviation of the changes e of the stiffness between modes: 10 % of a frequency."""
LEAST_STIFFNESS_SIGMA = 0.005
"""The least that is taken for it from the frequencies of the modes."""
ALIKE = 1e-6
"""Overlap of the coordinates that two modes move from which they may be coupled."""
BEYOND = 1.5
"""Factor by which the band of modes that are fitted exceeds the measured one."""


@dataclass(frozen=True)
class StageResponses:
    """Responses of the motions of a stage to forces on it, with changed modes of its suspension.

    With the momenta p_j = M v_j of modes, errors of the stiffness of the model and an added damping
    1/Q = eta_j add the sum of p_j C_jk p_k^T to its dynamic stiffness, C_jk = omega_j omega_k e_jk
    + i omega omega_j eta_j delta_jk. With the responses of and to the modes this is inverted
    exactly (Woodbury): G = G0 - U C (1 + Q C)^-1 W. Only modes that move the same coordinates are
    coupled: other couplings need parts that break the symmetry of the design.
    """

    omega: Float[np.ndarray, " frequency"]
    stage: Complex[np.ndarray, "frequency 6 6"]
    from_modes: Complex[np.ndarray, "frequency 6 mode"]
    to_modes: Complex[np.ndarray, "frequency mode 6"]
    between_modes: Complex[np.ndarray, "frequency mode mode"]
    mode_omega: Float[np.ndarray, " mode"]

    first: Int[np.ndarray, " change"]
    second: Int[np.ndarray, " change"]

    @staticmethod
    def of(plant: Plant, stage: str, frequency: Float[np.ndarray, " frequency"]) -> StageResponses:
        """Solve the model with its loops open; modes beyond the band stay as they are."""
        modes = modes_in_band(plant, frequency)
        ends = [Signal("", stage, dof, (0.0, 0.0, 0.0), acts=True) for dof in range(6)]
        forms = np.array([linear_form(end, plant.system) for end in ends])
        momenta = np.pad(plant.modal_forces[modes], ((0, 0), (6, 0)))
        both = np.concatenate([forms, momenta])
        omega = 2 * np.pi * frequency
        found, _ = response.transfer(plant.system, omega, both, [True] * len(both), both)
        moves = np.abs(plant.modal_forces[modes]) @ np.abs(plant.modes.shape[modes]).T
        first, second = np.nonzero(np.triu(moves > ALIKE))
        return StageResponses(
            omega,
            found[:, :6, :6],
            found[:, :6, 6:],
            found[:, 6:, :6],
            found[:, 6:, 6:],
            np.sqrt(plant.modes.omega_squared[modes]),
            first,
            second,
        )

    def stiffness(self, change: Float[np.ndarray, " change"]) -> Float[np.ndarray, "mode mode"]:
        """Stiffness between modes that relative changes e add."""
        w = self.mode_omega
        matrix = np.zeros((len(w), len(w)))
        matrix[self.first, self.second] = matrix[self.second, self.first] = change
        return w[:, None] * matrix * w

    def typical_change(self, change: Float[np.ndarray, " change"]) -> Float[np.ndarray, " change"]:
        """Typical size of each change e: the root mean square of those of coupled modes' own."""
        count = len(self.mode_omega)
        coupled = np.zeros((count, count))
        coupled[self.first, self.second] = coupled[self.second, self.first] = 1.0
        own = change[self.first == self.second]
        size = np.sqrt(coupled @ own**2 / coupled.sum(1))
        size = np.clip(size, LEAST_STIFFNESS_SIGMA, STIFFNESS_SIGMA)
        return np.sqrt(size[self.first] * size[self.second])

    def frequencies(self, change: Float[np.ndarray, " change"]) -> Float[np.ndarray, " mode"]:
        """Frequencies of the modes with relative changes e, Hz; NaN for an unstable one."""
        squared = np.linalg.eigvalsh(np.diag(self.mode_omega**2) + self.stiffness(change))
        with np.errstate(invalid="ignore"):
            return np.sqrt(squared) / (2 * np.pi)

    def at(
        self, change: Float[np.ndarray, " change"], damping: Float[np.ndarray, " mode"]
    ) -> ChangedModes:
        """Responses with relative changes e of the stiffness and an added 1/Q of the modes."""
        w = self.mode_omega
        lossy = 1j * self.omega[:, None] * w
        added = self.stiffness(change) + (lossy * damping)[:, None, :] * np.eye(len(w))
        mixed = np.eye(len(w)) + self.between_modes @ added
        to_modes = np.linalg.solve(mixed, self.to_modes)
        from_modes = np.linalg.solve(mixed, self.from_modes.swapaxes(1, 2)).swapaxes(1, 2)
        stage = self.stage - self.from_modes @ (added @ to_modes)
        return ChangedModes(stage, from_modes, to_modes)


@dataclass(frozen=True)
class ChangedModes:
    """Responses of a stage with changed modes; dG/dC_jk = -from_modes_j to_modes_k^T."""

    stage: Complex[np.ndarray, "frequency 6 6"]
    from_modes: Complex[np.ndarray, "frequency 6 mode"]
    to_modes: Complex[np.ndarray, "frequency mode 6"]

    def scaled(self, by: Float[np.ndarray, " 6"]) -> ChangedModes:
        """Responses in other units of each motion, of its forces in the inverse ones."""
        return ChangedModes(
            by[:, None] * self.stage / by, by[:, None] * self.from_modes, self.to_modes / by
        )


def modes_in_band(
    plant: Plant, frequency: Float[np.ndarray, " frequency"]
) -> Int[np.ndarray, " mode"]:
    """Number the modes whose frequencies are fitted."""
    hz = plant.modes.frequency
    with np.errstate(invalid="ignore"):
        inside = (hz > frequency.min() / BEYOND) & (hz < frequency.max() * BEYOND)
    return np.flatnonzero(inside)
