"""Equations of motion of LIGO's quadruple pendulum, from the state space that finesse-ligo ships.

`python -m tools.validation.quad_references FILE` reads `ligo_triple_suspension_ss.pbz2` of
finesse-ligo 1.0.15 (a quadruple, in spite of its name) and writes `measured/ligo/ligo-quad.toml`.
For x' = A x + B u, y = C x with u the forces on the bodies and y their motions, the mass matrix is
M = (C A B)^-1 and the static stiffness K = -(C A^-1 B)^-1. With `--infer` it also searches for the
geometry of `configs/built/ligo-quad.toml`: the lengths and stiffnesses for which the string model
has that K, starting from the numbers in the file.
"""

from __future__ import annotations

import bz2
import io
import pickle
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from suspension_cli.design import paths, reader
from suspension_cli.files.whole_files import write_bytes
from suspension_cli.models import registry
from tools.tables import ROOT
from tools.validation.sumcon_references import FREQUENCY

BODIES = {"top": "top", "upper": "uim", "penultimate": "pum", "test": "tst"}
"""LIGO's name of each stage."""
AXES = {"x": "L", "y": "T", "z": "V", "roll": "R", "pitch": "P", "yaw": "Y"}
PAIRS = [
    ("support.x", "test.x"),
    ("support.y", "test.y"),
    ("support.z", "test.z"),
    ("support.pitch", "test.pitch"),
    ("support.yaw", "test.yaw"),
    ("test.force_x", "test.x"),
    ("top.force_x", "test.x"),
    ("upper.force_x", "test.x"),
    ("penultimate.force_x", "test.x"),
    ("top.torque_pitch", "test.pitch"),
    ("penultimate.torque_pitch", "test.pitch"),
    ("top.torque_yaw", "test.yaw"),
    ("top.torque_roll", "top.roll"),
]
KEYS = {
    "top": ["l", "t1", "t2", "d", "k"],
    "upper": ["l", "s", "t1", "t2", "d", "d_upper", "k"],
    "penultimate": ["l", "s", "t1", "t2", "d", "d_upper", "k"],
    "test": ["l", "s", "t1", "t2", "d", "d_upper", "k"],
}
"""Keys of wires that the stiffness determines; those of blades are round numbers."""


class _Arrays(pickle.Unpickler):
    """Unpickler of numpy arrays alone: a pickle may otherwise run any code."""

    def find_class(self, module: str, name: str) -> Any:
        allowed = {"_reconstruct", "ndarray", "dtype", "scalar"}
        if module.partition(".")[0] != "numpy" or name not in allowed:
            raise pickle.UnpicklingError(f"{module}.{name} is no array")
        return super().find_class(module, name)


class Matrices:
    """Undamped equations of motion M x'' + K x = f + G g, with the ground's motions g.

    Coordinates are ours, in our order: six of each body, then of the ground.
    """

    def __init__(self, file: Path) -> None:
        found = _Arrays(io.BytesIO(bz2.decompress(file.read_bytes()))).load()
        a, b, c = (np.array(found[name]) for name in "ABC")
        inputs, outputs = ([str(one) for one in found[name]] for name in ("inputs", "outputs"))
        names = [f"{body}.{{}}.{axis}" for body in BODIES.values() for axis in AXES.values()]
        pushed = b[:, [inputs.index("in." + name.format("drive")) for name in names]]
        seen = c[[outputs.index("out." + name.format("disp")) for name in names]]
        ground = b[:, [inputs.index(f"in.gnd.disp.{axis}") for axis in AXES.values()]]
        self.mass = np.linalg.inv(seen @ a @ pushed)
        self.stiffness = np.linalg.inv(-seen @ np.linalg.solve(a, pushed))
        self.ground = self.stiffness @ -seen @ np.linalg.solve(a, ground)

    @property
    def frequency(self) -> np.ndarray:
        """Undamped modes, Hz."""
        squared = np.linalg.eigvals(np.linalg.solve(self.mass, self.stiffness)).real
        return np.sqrt(np.sort(squared)) / (2 * np.pi)

    def respond(self, source: str, output: str) -> np.ndarray:
        """Response of a motion to a force or a motion of the ground, at `FREQUENCY`."""
        names = [f"{body}.{axis}" for body in BODIES for axis in AXES]
        body, axis = source.split(".")
        number = list(AXES).index(axis.rpartition("_")[2])
        if body == "support":
            load = self.ground[:, number]
        else:
            load = np.eye(len(names))[6 * list(BODIES).index(body) + number]
        squared = (2 * np.pi * FREQUENCY[:, None, None]) ** 2
        found = np.linalg.solve(self.stiffness - squared * self.mass, load[:, None])
        return found[:, names.index(output), 0]


def stiffness(design: Any) -> np.ndarray:
    """Static stiffness of the bodies of a design in the string model, blade tips eliminated."""
    model = registry.by_name("string").system(design)
    whole = model.basis @ model.stiffness @ model.basis.T
    bodies, tips = slice(6, 30), slice(30, None)
    across = whole[bodies, tips]
    return whole[bodies, bodies] - across @ np.linalg.solve(whole[tips, tips], across.T)


def deviation(design: Any, known: np.ndarray) -> np.ndarray:
    """Deviation of each element of the stiffness, relative to it where it is not 0."""
    scale = np.sqrt(np.outer(np.diag(known), np.diag(known)))
    large = np.abs(known) > 1e-6 * scale
    return ((stiffness(design) - known) / np.where(large, np.abs(known), scale))[
        np.triu_indices(24)
    ]


def infer(text: str, known: np.ndarray) -> dict[str, float]:
    """Geometry for which the string model has a known stiffness."""
    raw = tomllib.loads(text)
    names = [f"stage.{stage}.wires.{key}" for stage, keys in KEYS.items() for key in keys]
    start = np.array([paths.value_at(raw, name) for name in names])

    def at(change: np.ndarray) -> Any:
        return reader.parse_with_overrides(
            text,
            tuple(
                f"{name}={float(value)!r}"
                for name, value in zip(names, start * np.exp(change), strict=True)
            ),
        )

    found = least_squares(
        lambda change: deviation(at(change), known), 0 * start, diff_step=1e-7, max_nfev=12
    )
    return dict(zip(names, (start * np.exp(found.x)).tolist(), strict=True))


def main() -> None:
    """Write the numbers of the state space."""
    matrices = Matrices(Path(sys.argv[1]))
    rows = {"frequency_hz": FREQUENCY}
    rows |= {f"{output} / {source}": matrices.respond(source, output) for source, output in PAIRS}
    document = {
        "source": {
            "file": "data/suspensions/ligo_triple_suspension_ss.pbz2",
            "repository": "finesse-ligo 1.0.15 (GPL-3.0-or-later)",
            "what": "state space of 48 states, 20140304TMproductionTM, without its damping",
        },
        "modes": {"frequency_hz": _digits(matrices.frequency)},
        "responses": {name: _digits(values) for name, values in rows.items()},
    }
    write_bytes(ROOT / "measured" / "ligo" / "ligo-quad.toml", reader.write_toml(document).encode())
    text = (ROOT / "configs" / "built" / "ligo-quad.toml").read_text("utf-8")
    worst = np.abs(deviation(reader.parse(text), matrices.stiffness)).max()
    print(f"largest deviation of an element of the stiffness: {worst:.1e}")
    for name, value in infer(text, matrices.stiffness).items() if "--infer" in sys.argv else ():
        print(f"{name} = {value:.7g}")


def _digits(values: np.ndarray) -> list[float]:
    return [float(f"{value:.9g}") for value in values]


if __name__ == "__main__":
    main()
