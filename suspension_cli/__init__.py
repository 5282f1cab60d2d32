"""pendsus: linear models of the pendulums that hang mirrors, from one TOML file.

The public API is that of `suspension_cli.api`; it is imported when its first name is used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from suspension_cli.version import __version__

__all__ = [
    "Design",
    "InputError",
    "PendsusError",
    "PendsusWarning",
    "Result",
    "__version__",
    "animate",
    "budget",
    "check",
    "compare",
    "damp",
    "draw",
    "example",
    "examples",
    "export",
    "fit",
    "info",
    "load",
    "modes",
    "optimise",
    "parse",
    "read",
    "report",
    "response",
    "sensitivity",
    "sweep",
    "template",
    "thermal",
    "tolerance",
    "tradeoff",
    "xcouple",
]

if TYPE_CHECKING:
    from suspension_cli.analyses.analysis import Result
    from suspension_cli.api import (
        Design,
        animate,
        budget,
        check,
        compare,
        damp,
        draw,
        example,
        examples,
        export,
        fit,
        info,
        load,
        modes,
        optimise,
        parse,
        read,
        report,
        response,
        sensitivity,
        sweep,
        template,
        thermal,
        tolerance,
        tradeoff,
        xcouple,
    )
    from suspension_cli.errors import InputError, PendsusError, PendsusWarning


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from suspension_cli import api, errors
    from suspension_cli.analyses import analysis

    home = next(module for module in (api, errors, analysis) if hasattr(module, name))
    return getattr(home, name)


def __dir__() -> list[str]:
    return __all__
