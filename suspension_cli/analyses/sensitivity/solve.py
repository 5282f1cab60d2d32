"""First derivatives of modes, responses and couplings with respect to the numbers of a design."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design import reader
from suspension_cli.design.paths import unit_of
from suspension_cli.files.declared import along, derived, in_unit
from suspension_cli.linear.named_results import Ratio, Scalar
from suspension_cli.models import registry
from suspension_cli.models.spectrum_error import has_wire_mass
from suspension_cli.physics import wire_modes
from suspension_cli.scene.arrays import Array
from suspension_cli.studies import builds, derivatives, parameters
from suspension_cli.studies.builds import Builds
from suspension_cli.studies.parameters import natural_step

if TYPE_CHECKING:
    from jaxtyping import Bool, Float


@dataclass(frozen=True)
class Sensitivity:
    """Derivatives of results with respect to a design's numbers.

    Attributes
    ----------
    parameter : tuple of str
        Dotted paths of the numbers that affect the matrices or cannot change alone.
    value : (p,) array
        Their values, SI.
    free : (p,) bool array
        Whether each can change alone, without unbalancing the nominal suspension.
    result, unit : tuple of str
        Names and units of the results, see `scalars`.
    nominal : (r,) array
        Results of the unchanged design.
    derivative : (p, r) array
        Unit of the result over that of the parameter; NaN where undefined (an unstable or rigid
        mode, a number that cannot change alone). A magnitude of 0 grows with either sign of the
        change.
    """

    parameter: tuple[str, ...]
    value: Float[np.ndarray, " parameter"] = field(metadata=in_unit("{parameter_unit}"))
    free: Bool[np.ndarray, " parameter"]
    result: tuple[str, ...]
    unit: tuple[str, ...] = field(metadata=along("result"))
    nominal: Float[np.ndarray, " result"] = field(metadata=in_unit("{unit}"))
    derivative: Float[np.ndarray, "parameter result"] = field(
        metadata=in_unit("{unit}/{parameter_unit}")
    )

    @property
    @derived(along="parameter")
    def parameter_unit(self) -> tuple[str, ...]:
        """SI unit of each number."""
        return tuple(unit_of(name) or "1" for name in self.parameter)

    @property
    @derived(along="result")
    def change_unit(self) -> tuple[str, ...]:
        """Unit of the changes of each result: %, or its own where it is 0."""
        pairs = zip(self.unit, self.nominal, strict=True)
        return tuple("%" if nominal else unit for unit, nominal in pairs)

    @property
    @derived("{change_unit}")
    def one_percent(self) -> Float[np.ndarray, "parameter result"]:
        """Change of each result by 1 % of each number, in % of it, or in its unit where it is 0."""
        return self._change(self.value / 100)

    @property
    @derived(along="parameter")
    def step_unit(self) -> tuple[str, ...]:
        """Step of each number: ``mm``, ``mrad`` or ``%``, see `studies.parameters.natural_step`."""
        return tuple(unit for _, unit in map(natural_step, self.parameter, self.value.tolist()))

    @property
    @derived("{parameter_unit}")
    def step(self) -> Float[np.ndarray, " parameter"]:
        """Step of each number, SI."""
        steps = map(natural_step, self.parameter, self.value.tolist())
        return np.array([size for size, _ in steps])

    @property
    @derived("{change_unit}")
    def per_step(self) -> Float[np.ndarray, "parameter result"]:
        """Change of each result by a step of each number, in the units of `one_percent`."""
        return self._change(self.step)

    def _change(
        self, step: Float[np.ndarray, " parameter"]
    ) -> Float[np.ndarray, "parameter result"]:
        with np.errstate(invalid="ignore", divide="ignore"):
            change = self.derivative * step[:, None]
            return np.where(self.nominal == 0, np.abs(change), 100 * change / self.nominal)


def solve(text: str, results: tuple[Scalar, ...], level: str = registry.STRING.name) -> Sensitivity:
    """Differentiate results with respect to every number of a design (TOML).

    `level` is the name of a model that supports derivatives.
    """
    design, numbers = reader.parse(text), parameters.every(text, level)
    model = registry.by_name(level).system(design)
    modes = wire_modes.solve_undamped_bodies(model)
    ratios = [item for item in results if isinstance(item, Ratio)]
    count, massive = len(modes.frequency), has_wire_mass(model)

    def evaluate(found: Builds) -> Array:
        matrix = derivatives.mode_matrix(found, modes, massive=massive).reshape(-1, count**2)
        values = builds.responses(found, ratios)
        return np.hstack([matrix, values, derivatives.flat_matrices(found)])

    around = derivatives.differentiate(design, numbers, level, evaluate)
    matrix = np.real(around.central[:, : count**2]).reshape(-1, count, count)
    places = slice(count**2, count**2 + len(ratios))
    size = np.abs(around.nominal[places])
    nominal = [*modes.frequency, *np.where(np.isfinite(size), size, np.nan)]
    rates = np.array([derivatives.frequency_rates(modes, one) for one in matrix])
    rates = np.hstack([rates.reshape(-1, count), around.of_magnitudes[:, places]])
    columns = [
        count + ratios.index(one) if isinstance(one, Ratio) else one.number for one in results
    ]
    kept = np.flatnonzero(around.matters | ~around.balanced)
    return Sensitivity(
        parameter=tuple(numbers[n].name for n in kept),
        value=np.array([numbers[n].value for n in kept]),
        free=around.balanced[kept],
        result=tuple(item.text for item in results),
        unit=tuple(item.unit for item in results),
        nominal=np.array(nominal)[columns],
        derivative=rates[kept][:, columns],
    )
