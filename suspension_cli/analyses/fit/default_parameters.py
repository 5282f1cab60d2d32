"""Parameters of a design that are free in a fit of transfer functions if the user names none.

Their priors are usual errors of careful building and of bought materials: a millimetre in lengths
and in the heights of wires' ends, a few per cent in blades.
"""

from __future__ import annotations

from suspension_cli.design import reader
from suspension_cli.design.measured import Free
from suspension_cli.models import registry
from suspension_cli.studies import derivatives, parameters

ABSOLUTE = {
    "d": 1e-3,
    "d_upper": 1e-3,
    "l": 1e-3,
    "s": 0.3e-3,
    "s_upper": 0.3e-3,
    "s_lower": 0.3e-3,
    "t1": 0.5e-3,
    "t2": 0.5e-3,
    "upper": 0.5e-3,
    "lower": 0.5e-3,
    "com_offset": 0.5e-3,
    "upper_offset": 0.5e-3,
    "lower_offset": 0.5e-3,
}
"""Prior standard deviations by key, m."""
RELATIVE = {
    "mass": 0.002,
    "density": 0.005,
    "inertia": 0.02,
    "stiffness": 0.03,
    "uncoupled_frequency": 0.015,
    "thickness": 0.01,
    "youngs_modulus": 0.02,
    "k": 0.02,
}
"""Prior standard deviations by key, relative to the value."""
TABLES = ("stage", "perturbation", "materials")


def choose(text: str, level: str = registry.STRING.name) -> list[Free]:
    """List the free parameters of a design, with priors around its values.

    >>> [item.name for item in choose(text)]  # doctest: +SKIP
    ['stage.test.body.mass', 'stage.test.body.inertia.1', ..., 'materials.steel302.youngs_modulus']
    """
    found = [item for item in parameters.every(text, level) if sigma_of(item.name, item.value)]
    around = derivatives.differentiate(reader.parse(text), found, level)
    return [
        Free(name=item.name, prior=item.value, uncertainty=sigma_of(item.name, item.value))
        for item, matters in zip(found, around.balanced & around.matters, strict=True)
        if matters
    ]


def sigma_of(name: str, value: float) -> float | None:
    """Prior standard deviation of a parameter, SI; None for one that is not free by default.

    >>> sigma_of("stage.test.wires.d", 0.002), sigma_of("stage.test.body.mass", 10.0)
    (0.001, 0.02)
    """
    keys = [key for key in name.split(".") if not key.isdigit()]
    if keys[0] not in TABLES:
        return None
    if keys[-1] in ABSOLUTE:
        return ABSOLUTE[keys[-1]]
    if keys[-1] in RELATIVE and value:
        return RELATIVE[keys[-1]] * abs(value)
    return None
