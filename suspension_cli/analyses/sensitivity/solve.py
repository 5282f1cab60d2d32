"""First derivatives of quantities with respect to the numbers of a design::

    quantities = find_results(["test pitch", "Q of test pitch"], names, source.text, "beam")
    found = solve(source.text, quantities, "beam", run=run.origin(analysis, choice))
    found.derivative  # (parameter, result)

Frequencies of undamped modes and responses follow from derivatives of matrices, exact to rounding
(`studies.derivatives`); all other quantities from differences extrapolated to a step of 0, with
their errors (`quantities.slopes`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.analyses.record import Record
from suspension_cli.design import reader
from suspension_cli.design.paths import unit_of
from suspension_cli.errors import InputError
from suspension_cli.files.declared import along, derived, in_unit
from suspension_cli.files.documents import Layout
from suspension_cli.models import registry
from suspension_cli.models.spectrum_error import has_wire_mass
from suspension_cli.physics import wire_modes
from suspension_cli.quantities import slopes
from suspension_cli.quantities.kinds.modes import FrequencyOfMode
from suspension_cli.quantities.kinds.responses import Ratio
from suspension_cli.quantities.needs import Needs
from suspension_cli.quantities.quantity import Quantity, evaluate
from suspension_cli.quantities.solved import Solved, of_designs
from suspension_cli.scene.arrays import Array
from suspension_cli.studies import builds, derivatives, parameters
from suspension_cli.studies.builds import Builds
from suspension_cli.studies.parameters import Parameter, natural_step

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

    from suspension_cli.analyses.record import Origin
    from suspension_cli.design.schema import Design


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivity(Record):
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
        Names and units of the results.
    nominal : (r,) array
        Results of the unchanged design.
    derivative : (p, r) array
        Unit of the result over that of the parameter; NaN where undefined (an unstable or rigid
        mode, a number that cannot change alone). A magnitude of 0 grows with either sign of the
        change.
    derivative_error : (p, r) array
        Estimated errors of derivatives from extrapolated differences; NaN of those of modes and
        responses, which are exact to rounding.
    """

    in_json: ClassVar = Layout(
        rows={"parameter": "parameters", "result": "results"},
        names={"parameter": "name", "result": "name"},
    )
    parameter: tuple[str, ...]
    value: Float[np.ndarray, " parameter"] = field(metadata=in_unit("{parameter_unit}"))
    free: Bool[np.ndarray, " parameter"]
    result: tuple[str, ...]
    unit: tuple[str, ...] = field(metadata=along("result"))
    nominal: Float[np.ndarray, " result"] = field(metadata=in_unit("{unit}"))
    derivative: Float[np.ndarray, "parameter result"] = field(
        metadata=in_unit("{unit}/{parameter_unit}")
    )
    derivative_error: Float[np.ndarray, "parameter result"] = field(
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

    @property
    def error_share(self) -> Float[np.ndarray, " result"]:
        """Largest error of the derivatives of each result, over its largest change; NaN if exact.

        Both per step of a number.
        """
        size = self.step[:, None]
        largest = np.fmax.reduce(np.abs(self.derivative * size), axis=0, initial=0.0)
        error = np.fmax.reduce(self.derivative_error * size, axis=0, initial=np.nan)
        with np.errstate(invalid="ignore", divide="ignore"):
            return error / largest

    def _change(
        self, step: Float[np.ndarray, " parameter"]
    ) -> Float[np.ndarray, "parameter result"]:
        with np.errstate(invalid="ignore", divide="ignore"):
            change = self.derivative * step[:, None]
            return np.where(self.nominal == 0, np.abs(change), 100 * change / self.nominal)


def solve(
    text: str,
    quantities: Sequence[Quantity],
    level: str = registry.STRING.name,
    *,
    run: Origin,
    vary: Sequence[str] = (),
    allow_unstable: bool = True,
) -> Sensitivity:
    """Differentiate quantities with respect to numbers of a design (TOML).

    `level` is the name of a model that supports derivatives, `run` what the record says of its
    origin, `vary` dotted paths of numbers or of tables of them, or none for every number.
    """
    design = reader.parse(text)
    numbers = parameters.choose(parameters.every(text, level), vary)
    exact = [one for one in quantities if isinstance(one, FrequencyOfMode | Ratio)]
    others = [one for one in quantities if not isinstance(one, FrequencyOfMode | Ratio)]
    solved = _balance(design, level, quantities, allow_unstable=allow_unstable)
    smooth = _differentiate_matrices(design, numbers, exact, solved)
    unknown = np.full(len(numbers), np.nan)
    nominal: dict[Quantity, float] = dict(zip(exact, smooth.nominal.tolist(), strict=True))
    rates: dict[Quantity, Array] = dict(zip(exact, smooth.rates.T, strict=True))
    errors: dict[Quantity, Array] = dict.fromkeys(exact, unknown)
    matters = smooth.matters
    if others:
        free = np.flatnonzero(smooth.balanced)
        chosen = [numbers[n] for n in free]
        found = slopes.differentiate(others, design, chosen, level, allow_unstable=allow_unstable)
        nominal |= zip(others, evaluate(others, solved)[0].tolist(), strict=True)
        for n, one in enumerate(others):
            rates[one] = unknown.copy()
            errors[one] = unknown.copy()
            rates[one][free] = found.value[:, n]
            errors[one][free] = found.error[:, n]
            matters = matters | (np.nan_to_num(rates[one]) != 0)
    kept = np.flatnonzero(matters | ~smooth.balanced)
    return Sensitivity(
        parameter=tuple(numbers[n].name for n in kept),
        value=np.array([numbers[n].value for n in kept]),
        free=smooth.balanced[kept],
        result=tuple(one.text for one in quantities),
        unit=tuple(one.unit for one in quantities),
        nominal=np.array([nominal[one] for one in quantities]),
        derivative=np.stack([rates[one] for one in quantities], axis=1)[kept],
        derivative_error=np.stack([errors[one] for one in quantities], axis=1)[kept],
        run=run,
    )


def _balance(
    design: Design, level: str, quantities: Sequence[Quantity], *, allow_unstable: bool
) -> Solved:
    """Balance the design itself; raises `InputError` if it has no equilibrium."""
    needs = Needs.of(quantities)
    found = [one for _, one in of_designs([design], level, needs, allow_unstable=allow_unstable)]
    if not found:
        registry.by_name(level).system(design)  # raises the fault of the design
        raise InputError.of(
            "stage", "has no equilibrium near the nominal pose", "see pendsus check"
        )
    return found[0]


@dataclass(frozen=True)
class _Smooth:
    """Modes and responses of a design, and their derivatives by its numbers."""

    nominal: Float[np.ndarray, " quantity"]
    rates: Float[np.ndarray, "number quantity"]
    balanced: Bool[np.ndarray, " number"]
    matters: Bool[np.ndarray, " number"]


def _differentiate_matrices(
    design: Design,
    numbers: Sequence[Parameter],
    quantities: Sequence[FrequencyOfMode | Ratio],
    solved: Solved,
) -> _Smooth:
    """Differentiate frequencies of undamped modes, and responses."""
    level = solved.level
    model = registry.by_name(level).system(design)
    modes = wire_modes.solve_undamped_bodies(model)
    massive = has_wire_mass(model)
    count = len(modes.frequency)
    ratios = [one for one in quantities if isinstance(one, Ratio)]

    def evaluate_matrices(found: Builds) -> Array:
        matrix = derivatives.mode_matrix(found, modes, massive=massive).reshape(-1, count**2)
        values = builds.responses(found, ratios)
        return np.hstack([matrix, values, derivatives.flat_matrices(found)])

    around = derivatives.differentiate(design, numbers, level, evaluate_matrices)
    matrix = np.real(around.central[:, : count**2]).reshape(-1, count, count)
    places = slice(count**2, count**2 + len(ratios))
    size = np.abs(around.nominal[places])
    nominal = np.array([*modes.frequency, *np.where(np.isfinite(size), size, np.nan)])
    rates = np.array([derivatives.frequency_rates(modes, one) for one in matrix])
    rates = np.hstack([rates.reshape(-1, count), around.of_magnitudes[:, places]])
    columns = [
        count + ratios.index(one) if isinstance(one, Ratio) else int(one.number(solved)[0])
        for one in quantities
    ]
    missing = np.array(columns) < 0  # a mode that the design does not have
    own = np.where(missing, np.nan, nominal[columns])
    own_rates = np.where(missing, np.nan, rates[:, columns])
    return _Smooth(own, own_rates, around.balanced, around.matters)
