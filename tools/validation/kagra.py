"""KAGRA's towers against the equations of motion that SUMCON exported."""

from __future__ import annotations

import csv

from tools.tables import ROOT
from tools.validation import counter_tests
from tools.validation.comparison import HEAD, Comparison, compare, details, row
from tools.validation.page import Section, table

SUSPENSIONS = {
    "kagra-pr3": (
        "PR3 (Type Bp)",
        "What is left is the inertia of the filters' blades, which SUMCON adds to the energy and"
        " `pendsus` takes from the masses. Blades on the support have none here: above 1 Hz the"
        " vertical response to the support is lower than SUMCON's, at 20 Hz by a factor of 3.6.",
    ),
    "kagra-prm": (
        "PRM (Type Bp)",
        "Five modes are off by up to 0.15 %: unexplained. The matrices have slightly other inertias"
        " than the save, which make it worse.",
    ),
    "kagra-bs": (
        "BS (Type B)",
        "As PR3. SUMCON loses the blades' inertia of F0: its vertical response to the support is"
        " lower, at 20 Hz by a factor of 4.7.",
    ),
    "kagra-bs-2019": (
        "BS (Type B), save of 2019",
        "The save has stiffer legs in yaw than its matrices. It is nearer to what was built than the"
        " other save of BS (below).",
    ),
    "kagra-srm": (
        "SRM (Type B)",
        "The save has stiffer legs in yaw than its matrices. SUMCON bends most wires for other"
        " tensions than they carry, down to half of them, which moves its hinges.",
    ),
    "kagra-sr3": (
        "SR3 (Type B)",
        "The matrices have the wires of the save's `wirelist`, and softer legs in yaw.",
    ),
    "kagra-typea": (
        "Type A, without heat links",
        "The vertical mode of the junction box JB (0.084 kg) depends on where the inertia of the"
        " blades of BF (0.2 kg) acts: in SUMCON between BF and JB, here on the keystone that carries"
        " JB. Heat links are left out: in SUMCON they have a negative stiffness (-0.19 N m/rad, pitch"
        " of MNR), as the vertical distance of their ends counts as strain.",
    ),
}
"""Title of each suspension, and what explains its deviations (`counter_tests`)."""
SHOWN = ("TM.x / support.x", "TM.z / support.z", "TM.yaw / IM.torque_yaw")


def compare_with_sumcon(name: str) -> Comparison:
    """Compute the modes and responses of one tower."""
    return compare(name, *SUSPENSIONS[name], peer="SUMCON", folder="sumcon")


def section() -> Section:
    """Compare all towers, write their pictures, and collect the page."""
    result = Section("KAGRA: SUMCON's equations of motion")
    found = [compare_with_sumcon(name) for name in SUSPENSIONS]
    result.lines += [
        "Saves of [SUMCON](../docs/migrating.md#saves-of-sumcon), KAGRA's modeller of suspensions,"
        " against the mass and stiffness matrices that it derived, without damping. `string` with"
        " hinges is SUMCON's model of a wire and has to agree; `beam` differs where thin ends are too"
        " short for hinges. Responses are from the support and from actuators, at 31 frequencies"
        " from 0.02 to 20 Hz.",
    ]
    result.lines += table(HEAD, [row(one) for one in found])
    for one in found:
        result.modes += one.modes()
    changed = [row for row in counter_tests.rows() if row[1] != counter_tests.UNCHANGED]
    result.lines += [
        "",
        "### Counter-tests of the reasons",
        "",
        "`python -m tools.validation counter-tests` changes the stated reason of a deviation:",
        *table(counter_tests.HEAD, changed, left=3),
    ]
    for one in found:
        result.lines += details(one, SHOWN)
    result.lines += _survey()
    return result


def _survey() -> list[str]:
    """Summarise the conversion of all public saves."""
    file = ROOT / "measured" / "sumcon" / "survey.csv"
    if not file.exists():
        return []
    with file.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    whole = [row for row in rows if row["modes"] and row["within 1e-3"] == row["modes"]]
    close = [row for row in rows if row["median"] and float(row["median"]) < 1e-3]
    converted = [row for row in rows if row["bodies"]]
    compared = [row for row in rows if row["within 1e-3"]]
    return [
        "",
        "### All public saves",
        "",
        f"Of {len(rows)} saves in the repository {len(converted)} convert; two name a stiffness table"
        f" that is missing. Of the {len(compared)} with matrices, {len(whole)} have all modes within"
        " 0.1 % of these, some with SUMCON's hinges (`--bending-points`); in"
        f" {len(close)} the median mode is within 0.1 %. The others were not looked into"
        " (`measured/sumcon/survey.csv`).",
    ]
