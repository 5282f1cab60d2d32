"""pendsus: linear models of the pendulums that hang mirrors, from one TOML file.

The public API is that of `suspension_cli.api`; it is imported when its first name is used.
"""

# pyright: reportUnsupportedDunderAll=false
from __future__ import annotations

from importlib import import_module
from typing import Any

from suspension_cli.conventions import ANALYSES
from suspension_cli.version import __version__

RECORDS = {
    "Budget": "budget.solve",
    "Check": "check.solve",
    "Comparison": "compare.solve",
    "Coupling": "xcouple.solve",
    "CouplingMatrix": "xcouple.solve",
    "Damped": "damp.solve",
    "Export": "export.solve",
    "Fit": "fit.result",
    "Modes": "modes.solve",
    "Optimum": "optimise.optimum",
    "Report": "report.solve",
    "Response": "response.solve",
    "Sensitivity": "sensitivity.solve",
    "Simulation": "simulate.solve",
    "Sweep": "sweep.solve",
    "Thermal": "thermal.solve",
    "Tolerance": "tolerance.summary",
    "Tradeoff": "tradeoff.measure",
}
"""Modules below `analyses` of the records that analyses return, by the names of their classes."""
__all__ = [
    "Design",
    "InputError",
    "PendsusError",
    "PendsusWarning",
    "Record",
    "__version__",
    "animate",
    "example",
    "examples",
    "finesse",
    "gwinc",
    "import_gwinc",
    "import_sumcon",
    "load",
    "parse",
    "python_control",
    "read",
    "template",
    *ANALYSES,
    *RECORDS,
]
__all__.sort()
HOMES = ("suspension_cli.errors", "suspension_cli.analyses.record", "suspension_cli.api")
"""Modules of the names; the stub beside this file has them for editors."""


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if name in RECORDS:
        return getattr(import_module(f"suspension_cli.analyses.{RECORDS[name]}"), name)
    modules = map(import_module, HOMES)
    return next(getattr(module, name) for module in modules if hasattr(module, name))


def __dir__() -> list[str]:
    return __all__
