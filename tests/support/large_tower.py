"""Designs with many bodies: a main chain, side chains that hang from its stages, and links.

A symmetric tower has its side chains around the main chain; in the other, they hang beside it.
"""

from __future__ import annotations

from math import pi, sqrt

MASS = 20.0
"""Mass of each body, kg."""
STRESS = 6e8
"""Stress of the wires, Pa."""
GRAVITY = 9.81


def large_tower(stages: int, pairs: int, links: int, *, symmetric: bool) -> str:
    """Write the design file of a tower of stages + 4 pairs bodies.

    Parameters
    ----------
    stages : int
        Bodies of the main chain, at least `pairs`.
    pairs : int
        Pairs of side chains of two bodies each; pair n hangs from stage n of the main chain.
    links : int
        Springs between bodies of the side chains and the stage below the one these hang from.
    symmetric : bool
        Whether the tower keeps both mirror symmetries.
    """
    text = ['[design]\nname = "large-tower"\n']
    loads = [MASS * (stages - n + 4 * max(0, pairs - n)) * GRAVITY for n in range(stages)]
    beam = 0.0 if symmetric else 1.4
    text += [_stage(f"stage{n + 1}", load, 0.5, 0.03, beam) for n, load in enumerate(loads)]
    sides = []
    for n in range(pairs):
        reach = 0.6 + 0.6 * (n % 2)
        for side, beside in (("left", -reach), ("right", reach)):
            above, place = f"stage{n + 1}", 0.0 if symmetric else beside
            for k, name in enumerate((f"{side}{n + 1}a", f"{side}{n + 1}b")):
                load = MASS * (2 - k) * GRAVITY
                text.append(_stage(name, load, 0.4, 0.05, 0.0, above, 0.0 if k else place))
                sides.append((name, f"stage{min(n + 2, stages)}"))
                above = name
    text += [
        _link(f"link{n + 1}", *ends, symmetric=symmetric) for n, ends in enumerate(sides[:links])
    ]
    return "\n".join(text)


def _stage(
    name: str,
    load: float,
    drop: float,
    half: float,
    beam: float,
    above: str = "",
    beside: float = 0.0,
) -> str:
    """Write a body on four wires at (+-half, +-half), `drop` below the body `above`.

    A drum, or a beam that reaches to x = +-beam.
    """
    radius = sqrt(load / 4 / STRESS / pi)
    lines = [f'[[stage]]\nname = "{name}"']
    lines += [f'hangs_from = "{above}"'] if above else []
    shape = 'shape = "cylinder", axis = "z", radius = 0.25, inner_radius = 0.2, length = 0.15'
    if beam:
        shape = f'shape = "box", size = [{2 * beam}, 0.1, 0.06]'
    lines += [f"position = [{beside}, 0.0, {-drop}]", f"body = {{ {shape}, mass = {MASS} }}"]
    for x, y in ((half, half), (half, -half), (-half, half), (-half, -half)):
        lines += [
            "[[stage.wire]]",
            f"upper = [{beside + x:.6g}, {y}, -0.01]",
            f"lower = [{x}, {y}, 0.01]",
            'material = "c70steel"',
            f"radius = {radius:.6g}",
        ]
    return "\n".join(lines) + "\n"


def _link(name: str, side: str, stage: str, *, symmetric: bool) -> str:
    """Write a soft spring between two bodies."""
    place = [0.0, 0.0, 0.05] if symmetric else [0.1, 0.05, 0.05]
    return (
        f'[[link]]\nname = "{name}"\nbetween = ["{side}", "{stage}"]\nat = {place}\n'
        "stiffness = [5.0, 3.0, 2.0, 0.01, 0.01, 0.02]\nloss_angle = 0.05\n"
    )
