"""`auto`: the lowest rung of the ladder whose error in what is asked for is under the tolerance.

Three refinements can be left out: blades as coordinates (`force` takes them in series), bending, torsion and loss of wires (`beam` has them), the mass
of wires (`violin`).  What they would change is estimated from the modes of the simplest model (`analysis.estimates`), before any other is built.  What is
far below the tolerance is left out and what is far above is taken; in between the asked quantity itself is sampled with and without the refinement.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from suspension_cli.analysis import modes
from suspension_cli.analysis.asked import Asked
from suspension_cli.analysis.estimates import BENDING, MASS, REFINEMENTS, SERIES, estimates
from suspension_cli.analysis.modes import Modes
from suspension_cli.design.scene import Array
from suspension_cli.design.schema import Design
from suspension_cli.mechanics import distributed
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.models import fidelity, force
from suspension_cli.models.fidelity import Choice

TOLERANCE = 1e-3
"""Relative error that `auto` allows by default."""
MARGIN = 0.8
"""Share of the tolerance that all refinements which are left out may be seen to change."""


@dataclass(frozen=True)
class Refinement:
    """What one refinement does to what is asked for.

    Attributes
    ----------
    name : str
        One of `estimates.REFINEMENTS`.
    indicator : float
        Estimated relative change of what is asked for; NaN where the design does not say enough.
    stage : str
        The stage that has most of it.
    change : float or None
        The relative change, sampled; None where the estimate settled it.
    taken : bool
    what : str
        What of all that is asked for changes so much; "" where it was not sampled.
    words : str
        What is to be said in the place of the estimate; "" if the number says it.
    """

    name: str
    indicator: float
    stage: str
    change: float | None
    taken: bool
    what: str = ""
    words: str = ""

    @property
    def size(self) -> str:
        """The estimate for people."""
        return self.words or f"{self.estimate:.1g}"

    @property
    def estimate(self) -> float:
        """Relative change of the asked quantity, sampled or estimated."""
        return self.indicator if self.change is None else self.change


@dataclass(frozen=True)
class Decision:
    """A rung, its model, and what was weighed."""

    choice: Choice
    model: LinearModel
    refinements: tuple[Refinement, ...]

    @property
    def missed(self) -> str:
        """Of what is asked for, that which changes most by what is left out; "" where nothing was sampled."""
        return "" if self._worst is None else self._worst.what

    @property
    def needed(self) -> str:
        """The rung that would have this; "" where nothing was sampled."""
        return "" if self._worst is None else REFINEMENTS[self._worst.name]

    @property
    def _worst(self) -> Refinement | None:
        left = [item for item in _left(list(self.refinements), self.choice.level) if item.change is not None]
        return max(left, key=lambda item: item.estimate, default=None)


def decide(design: Design, make: Callable[[LinearModel], Asked], tolerance: float = TOLERANCE, top: str = "violin") -> Decision:
    """The lowest rung on which what is asked for is right to a relative tolerance.

    Where a design does not say what its wires are made of, their bending and mass cannot be known, and are left out.

    Parameters
    ----------
    design : Design
    make : callable
        What is asked for, given the simplest model.
    tolerance : float
    top : str
        The highest rung that there is; what only higher ones have is left out, however large.
    """
    base = fidelity.choose(design)
    build = _Builder(design)
    asked, expected, stages, found = _expected(design, build(base.level), make)
    refinements = _series(design, base.level, asked, build, _room([], tolerance))
    for name in (BENDING, MASS):
        left = _only(name, stages, expected[name])
        refinements.append(_weigh(left, asked, build, tolerance, _room(refinements, tolerance)) if _reaches(top, name) else _sampled(left, asked, build))
    refinements = [replace(item, words=_words(item, found, build)) for item in refinements]
    level = next((REFINEMENTS[item.name] for item in reversed(refinements) if item.taken), base.level)
    reason = _reason(base, level, refinements, f"; tolerance {tolerance:g}")
    return Decision(Choice(level, reason, _error(refinements, level)), build(level), tuple(refinements))


def left_out(design: Design, choice: Choice, make: Callable[[LinearModel], Asked]) -> Decision:
    """What a rung leaves out that is taken whatever it leaves out: estimated, and computed where that counts.

    Parameters
    ----------
    design : Design
    choice : Choice
        Its error and reason are told anew.
    make : callable
        What is asked for, given the rung's model.
    """
    build = _Builder(design)
    if choice.level == "violin":
        return Decision(replace(choice, error=0.0), build(choice.level), ())
    asked, expected, stages, found = _expected(design, build(choice.level), make)
    refinements = [replace(item, taken=False) for item in _series(design, choice.level, asked, build, 0.0)]
    refinements += [_sampled(_only(name, stages, expected[name]), asked, build) for name in (BENDING, MASS) if not _reaches(choice.level, name)]
    refinements = [replace(item, words=_words(item, found, build)) for item in refinements]
    reason = _reason(choice, choice.level, refinements, "")
    return Decision(replace(choice, reason=reason, error=_error(refinements, choice.level)), build(choice.level), tuple(refinements))


def _expected(design: Design, model: LinearModel, make: Callable[[LinearModel], Asked]) -> tuple[Asked, dict[str, Array], tuple[str, ...], Modes]:
    """What is asked for, what the refinements of each stage's wires would change of it, these stages, and the model's modes."""
    asked, found = make(model), modes.solve(replace(model, terms=()))
    of = estimates(design, found)
    return asked, asked.estimated(found, of), of.stage, found


def _series(design: Design, level: str, asked: Asked, build: Callable[[str], LinearModel], room: float) -> list[Refinement]:
    """Blades as coordinates, where a rung takes them in series and that is not exact."""
    if level != "force" or not fidelity.approximate(design):
        return []
    change, what = asked.change(build("force"), build("string"))
    return [Refinement(SERIES, 1.0, force.series_is_approximate(design)[0], change, not change <= room, what)]


def _only(name: str, stages: tuple[str, ...], expected: Array) -> Refinement:
    """A refinement that is left out, with its estimate."""
    return Refinement(name, float(expected.sum()), stages[int(np.argmax(expected))] if stages else "", None, taken=False)


def _weigh(left: Refinement, asked: Asked, build: Callable[[str], LinearModel], tolerance: float, room: float) -> Refinement:
    """A refinement that is left out, or taken if it changes more than the `room` that is left."""
    low, high = asked.settled[left.name]
    if np.isnan(left.indicator) or left.indicator < low * tolerance:
        return left
    if left.indicator > high * tolerance:
        return replace(left, taken=True)
    seen = _changed(left, asked, build)
    return replace(seen, taken=not seen.estimate <= room)


def _sampled(left: Refinement, asked: Asked, build: Callable[[str], LinearModel]) -> Refinement:
    """A refinement that there is not; where it counts, with what it changes, as estimates are coarse."""
    return _changed(left, asked, build) if left.indicator > TOLERANCE else left


def _changed(left: Refinement, asked: Asked, build: Callable[[str], LinearModel]) -> Refinement:
    """A refinement with what it changes; one at a time."""
    change, what = asked.change(build({BENDING: "string", MASS: "beam"}[left.name]), build(REFINEMENTS[left.name]))
    return replace(left, change=change, what=what)


def _room(refinements: list[Refinement], tolerance: float) -> float:
    """What the next refinement may change if it is left out too."""
    level = next((REFINEMENTS[item.name] for item in reversed(refinements) if item.taken), "")
    return MARGIN * tolerance - float(np.nansum([item.estimate for item in _left(refinements, level)]))


def _reaches(level: str, name: str) -> bool:
    """Whether a rung has a refinement."""
    rungs = list(REFINEMENTS.values())
    return level in rungs and rungs.index(level) >= rungs.index(REFINEMENTS[name])


def _left(refinements: list[Refinement], level: str) -> list[Refinement]:
    """What a rung does not have; it has what it was not taken for too, if a lower rung has that."""
    return [item for item in refinements if not _reaches(level, item.name)]


def _error(refinements: list[Refinement], level: str) -> float:
    """What a rung leaves out, all together."""
    return float(sum(item.estimate for item in _left(refinements, level)))


class _Builder:
    """Builds the model of each rung once."""

    def __init__(self, design: Design) -> None:
        self._design = design
        self._known: dict[str, LinearModel] = {}

    def __call__(self, level: str) -> LinearModel:
        if level not in self._known:
            lighter = self._known.get("beam") if level == "violin" else None
            self._known[level] = fidelity.linear_model(self._design, level) if lighter is None else distributed.loaded(lighter)
        return self._known[level]


def _words(item: Refinement, found: Modes, build: Callable[[str], LinearModel]) -> str:
    """Why no number tells what a refinement changes, given the modes of the simplest model; "" if one does."""
    if item.name == BENDING and item.taken and not found.stable and modes.solve(replace(build("beam"), terms=())).stable:
        return unheld(found, unstable=True)
    if not np.isinf(item.estimate):
        return ""
    if item.name == MASS:
        return "near or above their violin modes"
    return unheld(found, unstable=item.change is not None) or "what was 0 is not"


def unheld(found: Modes, *, unstable: bool) -> str:
    """In words, which mode straight wires leave `unstable`, or else free to turn, that wires which bend hold; "" if there is none."""
    sign = -1 if unstable else 0
    names = [label for label, value in zip(found.label, found.omega_squared, strict=True) if np.sign(value) == sign]
    if not names:
        return ""
    return f"straight wires tip over in {names[0]}, bending holds it" if unstable else f"straight wires leave {names[0]} free, bending holds it"


def _reason(base: Choice, level: str, refinements: list[Refinement], limit: str) -> str:
    """One line: what was left out, and why."""
    left = _left(refinements, level)
    unknown = [item.name for item in left if np.isnan(item.indicator)]
    small = [f"{item.name} ({item.size})" for item in left if not np.isnan(item.indicator)]
    taken = [f"{item.name} ({item.size}{'' if item.words else f', {item.stage}'})" for item in refinements if item.taken]
    parts = [base.reason] if level == base.level else [f"for {', '.join(taken)}"]
    if small:
        parts.append(f"left out: {', '.join(small)}{limit}")
    if unknown:
        parts.append(f"unknown, as wires lack material or cross-section: {', '.join(unknown)}")
    return "; ".join(parts)
