"""Infer what Table I of Husman et al. (2000) does not print: the inertia of the mass and the radius of the wires.

One set (IX, IY, IZ, r) is fitted to the 24 theory values of all four cases at once, with the Young's modulus that
the authors measured.  The loss is robust (soft L1 on relative errors), as a few values are rounded coarsely and the
others should not bend towards them.  Prints the set, rounded to four digits, and what it leaves:

    python tools/infer_table1.py [paper.toml]
"""

from __future__ import annotations

import argparse
import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from suspension_cli.models import closed_form

START = (0.147, 0.117, 0.110, 142.5)
"""IX, IY, IZ in kg m^2 and r in um: an aluminium cylinder of 20 kg on wires of the stated diameters."""

SOFT = 3e-3
"""Relative error from which a residual counts linearly: about what rounding to two or three digits makes."""


def frequencies(parameters: Any, geometry: dict[str, float], mass: float, modulus: float) -> Any:
    """Frequencies of one case.

    Parameters
    ----------
    parameters : (4,) array
        IX, IY, IZ in kg m^2 and the wire radius in um.
    geometry : dict
        l, s, t1, t2, d in m.
    mass : float
        kg.
    modulus : float
        Young's modulus, Pa.

    Returns
    -------
    (6,) array
        Tilt, longitudinal, roll, sideways, rotation, vertical in Hz.
    """
    radius = 1e-6 * parameters[3]
    k = modulus * math.pi * radius**2 / geometry["l"]
    p = closed_form.FourWires(mass, tuple(parameters[:3]), k=k, **geometry)
    longitudinal, tilt = np.sort(-np.linalg.eigvals(closed_form.longitudinal_tilt(p)).real)
    sideways, roll = np.sort(-np.linalg.eigvals(closed_form.sideways_roll(p)).real)
    squares = [tilt, longitudinal, roll, sideways, closed_form.rotation(p), closed_form.vertical(p)]
    return np.sqrt(squares) / (2 * math.pi)


def residuals(parameters: Any, table: dict[str, Any]) -> Any:
    """Relative errors (cases, 6) against the printed theory."""
    rows = [frequencies(parameters, case["geometry"], table["mass"], table["youngs_modulus"]) / case["theory"] - 1 for case in table["case"]]
    return np.array(rows)


def infer(table: dict[str, Any]) -> Any:
    """IX, IY, IZ (kg m^2) and r (um) of the robust fit, rounded to four digits."""
    start = np.array(START)
    fit = least_squares(lambda scale: residuals(start * scale, table).ravel() / SOFT, np.ones(4), loss="soft_l1", xtol=1e-12, ftol=1e-12)
    return np.array([float(f"{value:.4g}") for value in start * fit.x])


def main() -> None:
    """Print the inferred set and its residuals."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="?", type=Path, default=Path(__file__).with_name("paper.toml"), help="the paper's tables as TOML")
    table = tomllib.loads(parser.parse_args().tables.read_text(encoding="utf-8"))["table1"]
    found = infer(table)
    errors = residuals(found, table)
    print("inertia = [{:.4g}, {:.4g}, {:.4g}]   # kg m^2\nradius = {:.4g}e-6                     # m".format(*found))
    print(f"\nrelative errors, per cent\ncase  {'  '.join(f'{name:>12}' for name in table['columns'])}")
    for case, row in zip(table["case"], errors, strict=True):
        print(f"{case['case']:>4}  {'  '.join(f'{100 * error:12.2f}' for error in row)}")
    size = np.abs(errors)
    print(f"\nworst {100 * size.max():.2f} %, median {100 * np.median(size):.2f} %")


if __name__ == "__main__":
    main()
