"""Parameters as they are printed: shortened names, and units in which changes are given."""

from __future__ import annotations

from suspension_cli.studies.parameters import natural_step


def change_unit(name: str, value: float) -> tuple[str, float]:
    """Choose the printed unit of a change of a parameter, and the factor to it from SI.

    >>> change_unit("stage.test.wires.d", 0.001), change_unit("stage.test.body.mass", 40.0)
    (('mm', 1000.0), ('%', 2.5))
    """
    step, unit = natural_step(name, value)
    return (unit, 1 / abs(step)) if step else ("SI", 1.0)


def short(name: str) -> str:
    """Shorten a path: ``stage.upper.wires.d`` to ``upper.d``.

    >>> short("stage.upper.wires.d"), short("stage.test.body.inertia.2")
    ('upper.d', 'test.inertia.2')
    """
    keys = name.split(".")
    if keys[0] == "stage":
        keys = [keys[1], *(key for key in keys[2:] if key not in ("wires", "body"))]
    return ".".join(keys)
