"""KAGRA's towers against the equations of motion that SUMCON exported."""

from __future__ import annotations

import csv
import tomllib
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from suspension_cli.drawing.style import PALETTE, house_style, new_figure, save
from tools.tables import ROOT
from tools.validation import undamped
from tools.validation.page import Section, percent, table

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
MODELS = ("string", "beam")
SHOWN = ("TM.x / support.x", "TM.z / support.z", "TM.yaw / IM.torque_yaw")


@dataclass(frozen=True)
class Comparison:
    """Numbers of SUMCON beside ours.

    Attributes
    ----------
    known, label
        Frequencies of SUMCON's modes that oscillate (Hz), and our names for them.
    ours
        Our frequencies by model, Hz.
    unstable
        Number of SUMCON's modes that do not oscillate.
    frequency, responses
        Frequencies (Hz), and SUMCON's and our responses by name.
    """

    name: str
    source: dict[str, str]
    known: np.ndarray
    label: list[str]
    ours: dict[str, np.ndarray]
    unstable: int
    frequency: np.ndarray
    responses: dict[str, tuple[np.ndarray, np.ndarray]]

    def error(self, model: str) -> np.ndarray:
        """Relative deviations of our modes."""
        return self.ours[model] / self.known - 1

    def response_error(self) -> np.ndarray:
        """Relative deviations of our responses, all in one list."""
        return np.concatenate([abs(ours / known - 1) for known, ours in self.responses.values()])


def compare(name: str) -> Comparison:
    """Compute the modes and responses of a design in `configs/built/`."""
    document = tomllib.loads((ROOT / "measured" / "sumcon" / f"{name}.toml").read_text("utf-8"))
    design = undamped.parse((ROOT / "configs" / "built" / f"{name}.toml").read_text("utf-8"))
    whole = np.array(document["modes"]["frequency_hz"])
    known, ours, labels = whole[whole > 1e-3], {}, {}
    for model in MODELS:
        found, names = undamped.frequencies(undamped.system(design, model))
        chosen = undamped.pair(known, found)
        ours[model], labels[model] = found[chosen], [names[n] for n in chosen]
    rows: dict[str, Any] = document["responses"]
    frequency = np.array(rows.pop("frequency_hz"))
    pairs = [(key.split(" / ")[1], key.split(" / ")[0]) for key in rows]
    values = undamped.respond(undamped.system(design, "string"), pairs, frequency)
    responses = {
        key: (np.array(rows[key]), value.real) for key, value in zip(rows, values, strict=True)
    }
    slow = int((whole <= 1e-3).sum())
    source = document["source"]
    return Comparison(name, source, known, labels["string"], ours, slow, frequency, responses)


def section() -> Section:
    """Compare all towers, write their pictures, and collect the page."""
    result = Section("KAGRA: SUMCON's equations of motion")
    found = [compare(name) for name in SUSPENSIONS]
    result.lines += [
        "[SUMCON](../docs/sumcon.md) is KAGRA's modeller of suspensions. `pendsus import` converts"
        " its saves; below, modes and responses without damping are held against the mass and"
        " stiffness matrices that SUMCON itself derived from them. `string` with hinges is"
        " SUMCON's model of a wire and has to agree; `beam` bends wires exactly, and differs where"
        " SUMCON's hinges, which take the thin end of a wire as endless, are too simple. Responses"
        " are those from the suspension point and from actuators, at 31 frequencies from 0.02 to"
        " 20 Hz.",
    ]
    head = [
        "suspension",
        "modes",
        "string within 0.1 %",
        "median",
        "worst mode",
        "beam, worst mode",
    ]
    head += ["responses within 1 %", "median"]
    result.lines += table(head, [_row(one) for one in found])
    for one in found:
        title, why = SUSPENSIONS[one.name]
        error = one.error("string")
        for n in np.argsort(-abs(error))[:1]:
            text = f"{title}, {one.label[n]} at {one.known[n]:.4g} Hz. {why}"
            result.worst.append((float(error[n]), text))
        result.lines += _details(one)
    result.lines += _survey()
    return result


def _row(one: Comparison) -> list[str]:
    error, beam, response = one.error("string"), one.error("beam"), one.response_error()
    cells = [SUSPENSIONS[one.name][0], str(len(error)), str(int((abs(error) < 1e-3).sum()))]
    cells.append(f"{100 * np.median(abs(error)):.1g} %")
    for part in (error, beam):
        n = int(np.argmax(abs(part)))
        cells.append(f"{percent(part[n])} ({one.label[n]})")
    share = (response < 1e-2).mean()
    return [*cells, f"{100 * share:.0f} %", f"{100 * np.median(response):.1g} %"]


def _details(one: Comparison) -> list[str]:
    title, why = SUSPENSIONS[one.name]
    picture = f"validation_{one.name.replace('-', '_')}.png"
    with house_style():
        save(draw(one), ROOT / "results" / picture)
    rows = [
        [label, f"{known:.5g}"]
        + [cell for m in MODELS for cell in (f"{one.ours[m][n]:.5g}", percent(one.error(m)[n]))]
        for n, (label, known) in enumerate(zip(one.label, one.known, strict=True))
    ]
    lines = ["", f"### {title}", "", why, "", f"![{title}]({picture})", ""]
    lines += [f"Design `configs/built/{one.name}.toml`; numbers: {one.source['what']},"]
    lines += [f"{one.source['file']} in {one.source['repository']}."]
    if one.unstable:
        lines += [f"SUMCON has {one.unstable} modes more, below 1 mHz or unstable."]
    lines += ["", "<details><summary>All modes</summary>", ""]
    lines += table(["mode", "SUMCON (Hz)", "string (Hz)", "", "beam (Hz)", ""], rows)
    return [*lines, "</details>"]


def draw(one: Comparison) -> Figure:
    """Draw the deviations of modes, and responses."""
    figure = new_figure(4.55, 4.6)
    upper, lower = figure.subplots(2, 1, gridspec_kw={"height_ratios": [1, 1.3]})
    for model, colour, mark in zip(MODELS, PALETTE, ("o", "x"), strict=False):
        error = np.maximum(abs(one.error(model)), 1e-9)
        upper.loglog(one.known, 100 * error, mark, color=colour, markersize=3, label=model)
    upper.set_xlabel("frequency of the mode (Hz)")
    upper.set_ylabel("deviation (%)")
    upper.legend(loc="best")
    names = [name for name in SHOWN if name in one.responses]
    for name, colour in zip(names, PALETTE, strict=False):
        known, ours = one.responses[name]
        lower.loglog(one.frequency, abs(ours), "-", color=colour, label=name)
        lower.loglog(one.frequency, abs(known), "o", color=colour, markersize=3, fillstyle="none")
    lower.set_xlabel("frequency (Hz); circles: SUMCON, lines: string model at the same points")
    lower.set_ylabel("response (m/m, rad/(N m))")
    lower.legend(loc="best")
    figure.suptitle(f"{SUSPENSIONS[one.name][0]}: modes and responses against SUMCON")
    figure.tight_layout()
    return figure


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
