"""Time of the stiffness of many triples by the force model, and of one by the string model."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from suspension_cli.design.reader import read
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import eigenmodes
from suspension_cli.models import force
from suspension_cli.models import string as string_model

TRIPLE = Path(__file__).parent.parent / "configs" / "husman2000" / "table2.toml"


def many_triples(count: int) -> force.Chain:
    """Vary each length and stiffness of the prototype triple by 1 %."""
    rng = np.random.default_rng(0)
    chain = force.chain(read(TRIPLE).design)
    vary = ("mass", "l", "t1", "t2", "d", "d_upper", "k", "s_upper", "s_lower", "blade_stiffness")
    stages = tuple(
        force.Stage(
            **{
                key: value * (1 + 0.01 * rng.standard_normal(count)) if key in vary else value
                for key, value in vars(stage).items()
            }
        )
        for stage in chain.stages
    )
    return force.Chain(stages, chain.gravity)


def run(ratio: Callable[..., None]) -> None:
    """Time the stiffness of 10,000 triples and its eigenvalues, and one string model."""
    chain = many_triples(10_000)
    bare = force.stiffness(chain)[..., 6:, 6:]
    ratio(
        "force, stiffness of 10,000 triples / its eigenvalues",
        lambda: force.stiffness(chain),
        lambda: np.linalg.eigvalsh(bare),
        1.8,
        5,
    )
    design = read(TRIPLE).design
    root = np.random.default_rng(0).normal(size=(18, 18))
    ratio(
        "string, build and solve one triple / numpy.linalg.eigh of 18 x 18",
        lambda: eigenmodes.solve(string_model.linear_model(expand(design))),
        lambda: np.linalg.eigh(root @ root.T),
        250.0,
        20,
    )
