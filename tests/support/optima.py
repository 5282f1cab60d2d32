"""Designs and goals that the tests of `pendsus optimise` share, and what they call."""

from __future__ import annotations

import suspension_cli as sus
from suspension_cli.analyses.optimise import solve as searching
from suspension_cli.analyses.optimise.evaluator import Evaluator
from suspension_cli.analyses.optimise.free_numbers import FreeDesign
from suspension_cli.design.goals import Equal, Free, Goal, Goals
from suspension_cli.design.schema import Perturbation
from tests.support.golden import CONFIGS, ROOT

PAPER = CONFIGS / "husman2000"
TRIPLE, WANTED = PAPER / "triple-vertical.toml", ROOT / "goals" / "geo600.toml"
VERTICAL, ANGLED, FIGURE3 = (
    PAPER / f"{name}.toml" for name in ("table1-case1", "table1-case2", "figure3")
)
EXAMPLE = (
    *["optimise", "configs/husman2000/triple-vertical.toml", "goals/geo600.toml", "--starts", "1"],
)
"""Of README.md: its line, run for `test_optimise_command.py`, is not run again for the
documents."""
WIRES = "stage.test.wires"
G = 9.81


def band(mode, **limit):
    """A goal for the frequency of one mode."""
    return Goal(kind="band", modes=[mode], **limit)


def free(key, lower, upper, **how):
    """A free number of the wires of the last stage."""
    return Free(name=f"{WIRES}.{key}", lower=lower, upper=upper, **how)


def solved(file, goal, free, equal=(), **how):
    """The optimum of a design, checked on `string`, from its own numbers alone unless given
    otherwise."""
    wanted = Goals(
        goal=goal,
        free=free,
        equal=list(equal),
        prefer=how.pop("prefer", "near"),
        margin=how.pop("margin", 1e-6),
    )
    return searching.solve(
        sus.parse(file if isinstance(file, str) else file.read_text()),
        wanted,
        **{"level": "string", "starts": 1} | how,
    )


def values_of(text, wanted):
    """Quantities of a freed design on the string model."""
    return Evaluator.of(FreeDesign.of(text, wanted), sus.parse(text))


EVERY = Goals(
    free=[
        Free(name="stage.middle.wires.t1", lower=0.03, upper=0.11),
        Free(name="stage.test.wires.l", lower=0.1, upper=0.4, scale="log"),
        Free(name="stage.middle.wires.radius", lower=1e-4, upper=3e-4),
        Free(name="stage.middle.body.mass", lower=3, upper=8),
        Free(name="stage.upper.blades.geometry.thickness", lower=1e-3, upper=3e-3),
    ],
    equal=[
        Equal(name="stage.test.body.mass", terms={"stage.middle.body.mass": 1.0}),
        Equal(name="stage.test.wires.d_upper", terms={"stage.test.wires.l": -0.01}, offset=0.004),
    ],
    goal=[
        Goal(kind="band", dof=["x", "y", "z", "yaw"], at_least=0.5, at_most=5.0),
        Goal(kind="band", modes=["middle pitch", "test vertical"], at_most=5.0),
        Goal(kind="coupling", dof=["x", "y", "z", "yaw"], at_least=0.01),
        Goal(kind="isolation", response="test.x@0,0,0.001/support.x:10", at_most=1e-3),
        Goal(
            kind="cross-coupling",
            response="test.x@0,0,-0.001/test.z/support.z:100",
            at_most=1e-3,
            perturbation=[Perturbation(wire="test.1", k_factor=1.2)],
        ),
        Goal(kind="stress", at_most=0.3),
        Goal(kind="height", at_most=0.9),
        Goal(kind="height", stage="middle", at_least=0.1),
    ],
)
"""Every kind of goal, numbers of every kind."""
