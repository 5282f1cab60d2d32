"""Words that a shell offers for the value of an option: paths of a design, signals, labels.

They are those of the first design that stands on the command line so far; none where there is no
design yet, or where it cannot be read.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from typing import Any

from suspension_cli.conventions import DOFS
from suspension_cli.design import reader
from suspension_cli.errors import PendsusError
from suspension_cli.linear.signals import FORCES


def complete(metavar: str, name: str, design: str, incomplete: str) -> list[str]:
    """List the words for an option that begin like an incomplete one.

    Parameters
    ----------
    metavar
        What help calls the value: ``PATH=VALUE``, ``SIGNAL``, ``QUANTITY``, ...
    name
        Name of the option's parameter.
    design
        The file of the design, or "".
    """
    listing = WORDS.get(metavar)
    if listing is None or not design:
        return []
    try:
        words = listing(reader.read(design), name)
    except PendsusError:
        return []
    return [word for word in words if word.startswith(incomplete)]


def _paths(source: reader.Source, _name: str) -> list[str]:
    """Dotted paths of all values of the file, with the sign that a value follows."""
    return [f"{path}=" for path in _paths_below(tomllib.loads(source.text), "")]


def _paths_below(value: Any, path: str) -> list[str]:
    if isinstance(value, dict):
        items = value.items()
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        items = [(one.get("name", str(n + 1)), one) for n, one in enumerate(value)]
    else:
        return [path]
    prefix = f"{path}." if path else ""
    return [found for key, one in items for found in _paths_below(one, f"{prefix}{key}")]


def _stages(source: reader.Source, _name: str) -> list[str]:
    """Names of the stages."""
    return [stage.name for stage in source.design.stage]


def _signals(source: reader.Source, name: str) -> list[str]:
    """Motions of stages; of inputs those of the support, and forces on stages."""
    stages = _stages(source, name)
    if name not in ("input", "inputs"):
        return [f"{stage}.{dof}" for stage in stages for dof in DOFS]
    forces = [f"{stage}.{force}" for stage in stages for force in FORCES]
    return [*(f"support.{dof}" for dof in DOFS), *forces]


def _quantities(source: reader.Source, _name: str) -> list[str]:
    """Labels of modes, alone and with the words of what has one."""
    from suspension_cli.linear import eigenmodes
    from suspension_cli.models import registry

    labels = eigenmodes.solve(registry.STRING.system(source.design).constant).label
    qs = [f"Q of {label}" for label in labels]
    noise = [f"thermal {signal}:" for signal in _signals(source, "outputs")]
    return ["modes", "coupling", *labels, *qs, *noise]


WORDS: dict[str, Callable[[reader.Source, str], list[str]]] = {
    "PATH=VALUE": _paths,
    "PATH=GRID": _paths,
    "SIGNAL": _signals,
    "STAGE": _stages,
    "QUANTITY": _quantities,
}
"""What is listed by what help calls a value."""
