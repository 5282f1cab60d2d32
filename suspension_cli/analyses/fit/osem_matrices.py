"""Sensing and driving matrices of OSEMs as measured, and what they leave of couplings."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.files.declared import SI, along, derived, in_unit
from suspension_cli.files.documents import Layout

if TYPE_CHECKING:
    from jaxtyping import Float


@dataclass(frozen=True)
class OsemFit:
    """Matrices from the measured transfer functions of all sensors of a stage to all its coils.

    The measured functions are A G B: with the rows A of sensors, the responses G of the stage in
    the model, and the columns B of coils. `sensing` and `driving` are S and D with S A = 1 and
    B D = 1, so that S A G B D is G. Each motion has the scale at which the nominal sensing matrix
    reads it: the diagonal of S_nominal A is 1. Errors that all sensors share are in the coils.

    Attributes
    ----------
    stage, reference
        Stage of the OSEMs and their reference.
    sensor, coil, motion
        Names of OSEMs whose sensors and coils were measured, and the motions that both resolve.
    sensing_nominal, sensing, sensing_sigma
        Motions (m, rad) from readings (m), and their standard deviations.
    driving_nominal, driving, driving_sigma
        Forces of coils (N) from forces and torques along the motions (N, N m).
    covariance
        Of all elements of `sensing`, row by row, then of `driving`.
    sensing_rows, driving_rows
        Readings per motion, and forces and torques per force of a coil: `[[control.osem]]`.
    mode, mode_nominal, mode_frequency, mode_sigma
        Modes in the measured band, their frequencies in the model and as fitted, Hz.
    delay, delay_sigma
        Delay that all functions share, s.
    frequency, pair
        Hz, and pairs of motions.
    before, after
        Coupling of each pair with the nominal and with the found matrices: the larger one of
        abs(X_ij) and abs(X_ji) over the root of abs(X_ii X_jj), with X = S H D of the data H.
    noise
        Standard deviation that the noise of the data gives to `after`.
    suspension
        The same coupling of the model, which no constant matrix removes.
    """

    in_json: ClassVar = Layout(
        names={"sensor": "sensors", "coil": "coils", "motion": "motions", "pair": "pairs"},
        without="before after noise suspension covariance frequency",
        also="median_before median_after median_noise median_suspension largest_after",
    )
    stage: str
    reference: str
    sensor: tuple[str, ...]
    coil: tuple[str, ...]
    motion: tuple[str, ...]
    sensing_nominal: Float[np.ndarray, "motion sensor"] = field(metadata=in_unit(SI))
    sensing: Float[np.ndarray, "motion sensor"] = field(metadata=in_unit(SI))
    sensing_sigma: Float[np.ndarray, "motion sensor"] = field(metadata=in_unit(SI))
    driving_nominal: Float[np.ndarray, "coil motion"] = field(metadata=in_unit(SI))
    driving: Float[np.ndarray, "coil motion"] = field(metadata=in_unit(SI))
    driving_sigma: Float[np.ndarray, "coil motion"] = field(metadata=in_unit(SI))
    covariance: Float[np.ndarray, "element other_element"] = field(metadata=in_unit(SI))
    sensing_rows: Float[np.ndarray, "sensor coordinate"] = field(metadata=in_unit(SI))
    driving_rows: Float[np.ndarray, "coil coordinate"] = field(metadata=in_unit(SI))
    mode: tuple[str, ...]
    mode_nominal: Float[np.ndarray, " mode"] = field(metadata=in_unit("Hz"))
    mode_frequency: Float[np.ndarray, " mode"] = field(metadata=in_unit("Hz"))
    mode_sigma: Float[np.ndarray, " mode"] = field(metadata=in_unit("Hz"))
    delay: float = field(metadata=in_unit("s"))
    delay_sigma: float = field(metadata=in_unit("s"))
    frequency: Float[np.ndarray, " frequency"] = field(metadata=in_unit("Hz"))
    pair: tuple[str, ...] = field(metadata=along("pair"))
    before: Float[np.ndarray, "frequency pair"]
    after: Float[np.ndarray, "frequency pair"]
    noise: Float[np.ndarray, "frequency pair"]
    suspension: Float[np.ndarray, "frequency pair"]

    @property
    @derived()
    def element(self) -> tuple[str, ...]:
        """Names of the elements of both matrices, as in the covariance."""
        sensing = [f"{motion} from {name}" for motion in self.motion for name in self.sensor]
        driving = [f"{name} for {motion}" for name in self.coil for motion in self.motion]
        return (*sensing, *driving)

    @property
    @derived()
    def reversed_sensors(self) -> tuple[str, ...]:
        """Sensors whose sign is the opposite of the design's."""
        return self._reversed(self.sensor, self.sensing_nominal, self.sensing)

    @property
    @derived()
    def reversed_coils(self) -> tuple[str, ...]:
        """Coils whose sign is the opposite of the design's."""
        return self._reversed(self.coil, self.driving_nominal.T, self.driving.T)

    @staticmethod
    def _reversed(
        names: tuple[str, ...],
        nominal: Float[np.ndarray, "motion osem"],
        found: Float[np.ndarray, "motion osem"],
    ) -> tuple[str, ...]:
        """List OSEMs that enter most motions with the other sign, each in units of its row."""
        size = np.linalg.norm(nominal, axis=1, keepdims=True)
        along = (nominal * found / size**2).sum(0)
        return tuple(name for name, one in zip(names, along, strict=True) if one < 0)

    @property
    def median_before(self) -> Float[np.ndarray, " pair"]:
        """Median over frequencies of `before`."""
        return np.median(self.before, axis=0)

    @property
    def median_after(self) -> Float[np.ndarray, " pair"]:
        """Median over frequencies of `after`."""
        return np.median(self.after, axis=0)

    @property
    def median_noise(self) -> Float[np.ndarray, " pair"]:
        """Median over frequencies of `noise`."""
        return np.median(self.noise, axis=0)

    @property
    def median_suspension(self) -> Float[np.ndarray, " pair"]:
        """Median over frequencies of `suspension`."""
        return np.median(self.suspension, axis=0)

    @property
    def largest_after(self) -> Float[np.ndarray, " pair"]:
        """Largest value over frequencies of `after`."""
        return np.max(self.after, axis=0)
