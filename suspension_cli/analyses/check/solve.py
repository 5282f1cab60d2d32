"""Validity and plausibility of a design, and loads of its wires and blades."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from suspension_cli.errors import InputError

if TYPE_CHECKING:
    from suspension_cli.analyses.check.statics import Statics, WireWeights
    from suspension_cli.design.checks import ImplausibleNumber
    from suspension_cli.design.reader import Source
    from suspension_cli.models.registry import Choice


@dataclass(frozen=True)
class Check:
    """A valid design: loads of its wires and blades, and implausible numbers.

    Attributes
    ----------
    choice : Choice
        The simplest valid model.
    stable, stability_model : bool, str or None
        Whether it is stable, and in which model; None if not computed.
    """

    choice: Choice
    statics: Statics
    stable: bool | None
    stability_model: str | None
    warnings: list[ImplausibleNumber]

    @property
    def weights(self) -> WireWeights | None:
        """Weight of the wires; None if no density is known."""
        return self.statics.weights


def solve(source: Source) -> Check:
    """Check a design.

    Raises
    ------
    InputError
        If it does not balance, with the implausible numbers that may be the reason.
    """
    import tomllib

    from suspension_cli.analyses.check import statics, warnings
    from suspension_cli.design import checks
    from suspension_cli.design.paths import value_at
    from suspension_cli.models import registry

    design = source.design
    found = checks.find_implausible(design)
    try:
        choice, loads = registry.choose(design), statics.solve(design)
    except InputError as error:
        raise InputError([*error.faults, *found], source.file) from None
    found += warnings.find_implausible_loads(design, loads)
    model, modes, unstable = warnings.find_stability(design)
    found += [*unstable, *warnings.find_slackest(loads)]
    raw = tomllib.loads(source.text)
    leads = lambda path: value_at(raw, path) is not None  # noqa: E731
    found += warnings.find_unknown_names(design, modes, leads)
    stable = None if model is None else not unstable
    return Check(choice, loads, stable, model, found)
