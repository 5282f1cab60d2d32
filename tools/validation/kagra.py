"""KAGRA's towers against the equations of motion that SUMCON exported."""

from __future__ import annotations

import csv

import numpy as np

from tools.tables import ROOT
from tools.validation.comparison import HEAD, Comparison, compare, details, row
from tools.validation.page import Section, table

SUSPENSIONS = {
    "kagra-pr3": (
        "PR3 (Type Bp)",
        "What is left is the inertia of the filters' blades: SUMCON adds it to the energy, here it"
        " is part of the masses. Above 1 Hz the vertical response to the suspension point is lower"
        " than SUMCON's, by a factor of 3.6 at 20 Hz: blades on the support have no inertia here.",
    ),
    "kagra-prm": (
        "PRM (Type Bp)",
        "The inertias of IM, RM and TM in the save were changed by up to 0.1 % after its matrices"
        " were computed: the matrices have 0.2202 kg m² for pitch of IM, the table 0.22.",
    ),
    "kagra-bs": (
        "BS (Type B)",
        "What is left is the inertia of the filters' blades, as in PR3. Above 1 Hz the vertical"
        " response to the suspension point is higher than SUMCON's, by a factor of 4.7 at 20 Hz:"
        " SUMCON loses the inertia of the blades of F0, whose height is no variable of its own.",
    ),
    "kagra-bs-2019": (
        "BS (Type B), save of 2019",
        "Only yaw of F0 is off by more than 0.1 %, as if the legs' yaw stiffness had been"
        " changed by 1.7 % after the matrices of the save were computed. This save is nearer to"
        " what was built than the other one of BS: see the measured transfer functions below.",
    ),
    "kagra-srm": (
        "SRM (Type B)",
        "The yaw stiffness of the legs was changed after the matrices of the save were computed:"
        " the table has 700 N m/rad, the matrices 350. For the rest, SUMCON bends most wires for"
        " tensions of another payload, down to half of what they carry, which moves their hinges:"
        " with the hinges there (`import --bending-points`) 44 of 45 modes are within 0.1 %.",
    ),
    "kagra-sr3": (
        "SR3 (Type B)",
        "The stiffness of the legs and the length, k and torsion of most wires were changed after"
        " the matrices of the save were computed (its `wirelist` has the old wires): these"
        " parameters and matrices do not belong together. Hinges as in SRM.",
    ),
    "kagra-typea": (
        "Type A, without heat links",
        "The blades' inertia (0.2 kg) exceeds the mass of the junction box JB (0.084 kg), whose"
        " vertical mode SUMCON therefore puts at 1368 Hz; the other deviations are this inertia,"
        " too. Heat links are left out, as SUMCON's have negative stiffness (-0.19 N m/rad, pitch"
        " of MNR): it counts the vertical distance of their ends as strain.",
    ),
}
"""Title of each suspension, and what explains its deviations."""
SHOWN = ("TM.x / support.x", "TM.z / support.z", "TM.yaw / IM.torque_yaw")


def compare_with_sumcon(name: str) -> Comparison:
    """Compute the modes and responses of one tower."""
    return compare(name, *SUSPENSIONS[name], peer="SUMCON", folder="sumcon")


def section() -> Section:
    """Compare all towers, write their pictures, and collect the page."""
    result = Section("KAGRA: SUMCON's equations of motion")
    found = [compare_with_sumcon(name) for name in SUSPENSIONS]
    result.lines += [
        "[SUMCON](../docs/migrating.md#saves-of-sumcon) is KAGRA's modeller of suspensions."
        " `pendsus import` converts its saves; below, modes and responses without damping are held"
        " against the mass and stiffness matrices that SUMCON itself derived from them. `string`"
        " with hinges is SUMCON's model of a wire and has to agree; `beam` bends wires exactly, and"
        " differs where"
        " SUMCON's hinges, which take the thin end of a wire as endless, are too simple. Responses"
        " are those from the suspension point and from actuators, at 31 frequencies from 0.02 to"
        " 20 Hz.",
    ]
    result.lines += table(HEAD, [row(one) for one in found])
    for one in found:
        error = one.error("string")
        for n in np.argsort(-abs(error))[:1]:
            text = f"{one.title}, {one.label[n]} at {one.known[n]:.4g} Hz. {one.why}"
            result.worst.append((float(error[n]), text))
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
    lines = [
        "",
        "### All public saves",
        "",
        f"Of {len(rows)} different saves in the repository {len(converted)} convert; two name a"
        f" stiffness table that is not there. Of the {len(compared)} with matrices to compare,"
        f" {len(whole)} have all modes within 0.1 % of these matrices, some of them with SUMCON's"
        f" hinges (`--bending-points`); in {len(close)} the median mode is. Where it is checked"
        " above, the others were edited after their matrices were computed, or the inertia of"
        " blades weighs more.",
        "",
        "<details><summary>Save by save</summary>",
        "",
    ]
    head = list(rows[0])
    return [*lines, *table(head, [list(row.values()) for row in rows]), "</details>"]
