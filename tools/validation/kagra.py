"""KAGRA's towers against the equations of motion that SUMCON exported."""

from __future__ import annotations

import csv

import suspension_cli as sus
from tools.tables import ROOT
from tools.validation import counter_tests
from tools.validation.comparison import HEAD, Comparison, compare, details, row
from tools.validation.page import Section, table

SUSPENSIONS = {
    "kagra-pr3": (
        "PR3 (Type Bp)",
        "what is left is the inertia of the filters' blades, which SUMCON adds and `pendsus` takes"
        " from the masses. Blades on the support have none here: above 1 Hz the vertical response to"
        " the support is lower than SUMCON's, at 20 Hz by a factor of 3.6.",
    ),
    "kagra-prm": (
        "PRM (Type Bp)",
        "unexplained; the slightly other inertias of the matrices make it worse.",
    ),
    "kagra-bs": (
        "BS (Type B)",
        "as PR3, but SUMCON loses the blades' inertia of F0: its vertical response to the support is"
        " lower, at 20 Hz by a factor of 4.7.",
    ),
    "kagra-bs-2019": (
        "BS (Type B), save of 2019",
        "stiffer legs in yaw than the matrices. Nearer to what was built than the other save (below).",
    ),
    "kagra-srm": (
        "SRM (Type B)",
        "stiffer legs in yaw than the matrices. SUMCON bends most wires for other tensions than they"
        " carry, down to half of them, which moves its hinges.",
    ),
    "kagra-sr3": (
        "SR3 (Type B)",
        "the matrices have the wires of the save's `wirelist`, and softer legs in yaw.",
    ),
    "kagra-typea": (
        "Type A, without heat links",
        "the vertical mode of the junction box JB (0.084 kg) depends on where the inertia of the"
        " blades of BF (0.2 kg) acts: in SUMCON between BF and JB, here on the keystone that carries"
        " JB. Heat links are left out: in SUMCON their stiffness is negative, as the vertical distance"
        " of their ends counts as strain.",
    ),
}
"""Title of each suspension, and what explains its deviations (`counter_tests`)."""
SHOWN = ("TM.x / support.x", "TM.z / support.z", "TM.yaw / IM.torque_yaw")


def compare_with_sumcon(name: str) -> Comparison:
    """Compute the modes and responses of one tower."""
    return compare(name, *SUSPENSIONS[name], peer="SUMCON", folder="sumcon")


def effect_of_losses() -> str:
    """Describe the mode of BS that its losses shift most."""
    name, label = "kagra-bs", "F2 vertical"
    one = compare_with_sumcon(name)
    without = one.ours["string"][one.label.index(label)]
    found = sus.modes(ROOT / "configs" / "built" / f"{name}.toml", fidelity="string")
    n = list(found.label).index(label)
    return (
        f"vertical of F2 of KAGRA's BS, {without:.5f} Hz there, is at {found.frequency[n]:.5f} Hz, with"
        f" a Q of {found.q[n]:.1f}, in `pendsus modes configs/built/{name}.toml --fidelity string`"
    )


def section() -> Section:
    """Compare all towers, write their pictures, and collect the page."""
    result = Section("KAGRA: SUMCON's equations of motion")
    found = [compare_with_sumcon(name) for name in SUSPENSIONS]
    result.lines += [
        "Saves of [SUMCON](../docs/migrating.md#saves-of-sumcon), KAGRA's modeller of suspensions,"
        " against the mass and stiffness matrices that it derived. `string` with hinges is SUMCON's"
        " model of a wire and has to agree; `beam` differs where thin ends are too short for hinges."
        " Responses to the support and to actuators at 31 frequencies from 0.02 to 20 Hz. Printed by"
        " `python -m tools.validation kagra-pr3`, and so on.",
    ]
    result.lines += table(HEAD, [row(one) for one in found])
    for one in found:
        result.modes += one.modes()
    changed = [row for row in counter_tests.rows() if row[1] != counter_tests.UNCHANGED]
    result.lines += [
        "",
        "### Counter-tests of the reasons",
        "",
        "`counter-tests` changes the stated reason of a deviation:",
        *table(counter_tests.HEAD, changed, left=3),
    ]
    for one in found:
        result.lines += details(one, SHOWN)
    result.lines += survey()
    return result


def survey() -> list[str]:
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
        f"{len(converted)} of {len(rows)} saves convert; two name a missing stiffness table. Of the"
        f" {len(compared)} with matrices, {len(whole)} have all modes within 0.1 %, some with SUMCON's"
        f" hinges (`--bending-points`); in {len(close)} the median mode is within 0.1 %. The others"
        " were not looked into (`kagra-saves`; `measured/sumcon/survey.csv`).",
    ]
