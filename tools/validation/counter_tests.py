"""Counter-tests: what the page gives as the reason of a deviation is changed, and it has to go.

`python -m tools.validation.counter_tests` prints them; the page has those with a change.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field

import numpy as np

from suspension_cli.design import reader
from tools.tables import ROOT
from tools.validation import undamped
from tools.validation.page import percent, table

LEG_YAW = "stage.F0.spring.1.stiffness.6"
BLADES_OF_BF = {"stage.BF.filter.keystone.mass": 1e-6, "stage.BF.filter.mass_coupling": 0.0}

INERTIAS_OF_PRM = {
    "stage.IM.body.inertia.2": 0.2202,
    "stage.IM.body.inertia.3": 0.31687,
    "stage.RM.body.inertia.2": 0.17296,
    "stage.RM.body.inertia.3": 0.15113,
    "stage.TM.body.inertia.3": 0.047656,
}
"""Inverse of the drive of SUMCON's state space, where it differs from the save, kg m^2."""


@dataclass(frozen=True)
class Change:
    """A change of a design, and the mode whose deviation it is to explain.

    Attributes
    ----------
    design
        Stem of the file in `configs/built/`.
    what
        The change in words.
    mode
        Label of the mode.
    values
        Values by dotted path.
    wires
        Whether the wires are those with which SUMCON derived its matrices (`wirelist` of the save).
    """

    design: str
    what: str
    mode: str
    values: dict[str, float] = field(default_factory=dict)
    wires: bool = False


UNCHANGED = "as in the save"
CHANGES = [
    Change("kagra-srm", UNCHANGED, "F0 yaw"),
    Change("kagra-srm", "legs' yaw 350 N m/rad (save: 700)", "F0 yaw", {LEG_YAW: 350.0}),
    Change("kagra-srm", "and SUMCON's hinges", "F0 yaw", {LEG_YAW: 350.0}, wires=True),
    Change("kagra-sr3", UNCHANGED, "F0 yaw"),
    Change("kagra-sr3", "wires of `wirelist`", "F0 yaw", wires=True),
    Change("kagra-sr3", "and legs' yaw 35 N m/rad (save: 650)", "F0 yaw", {LEG_YAW: 35.0}, True),
    Change("kagra-bs-2019", UNCHANGED, "F0 yaw"),
    Change("kagra-bs-2019", "legs' yaw 75 N m/rad (save: 80)", "F0 yaw", {LEG_YAW: 75.0}),
    Change("kagra-prm", UNCHANGED, "IM pitch"),
    Change("kagra-prm", "inertias of the matrices", "IM pitch", INERTIAS_OF_PRM),
    Change("kagra-typea", UNCHANGED, "JB vertical"),
    Change("kagra-typea", "blades of BF without inertia", "JB vertical", BLADES_OF_BF),
]


def deviations(change: Change) -> tuple[np.ndarray, list[str]]:
    """Relative deviations of the modes from SUMCON's, and their labels, in the string model."""
    text = (ROOT / "configs" / "built" / f"{change.design}.toml").read_text("utf-8")
    numbers = tomllib.loads(
        (ROOT / "measured" / "sumcon" / f"{change.design}.toml").read_text("utf-8")
    )
    values = dict(change.values)
    if change.wires:
        text = text.replace('bending = "hinged"\n', "")  # the ends are hinges already
        values |= numbers["wires_of_the_matrices"]
    overrides = tuple(f"{path}={value!r}" for path, value in values.items())
    design = undamped.parse(reader.edit(text, overrides))
    known = np.array(numbers["modes"]["frequency_hz"])
    known = known[known > 1e-3]
    found, labels = undamped.frequencies(undamped.system(design, "string"))
    chosen = undamped.pair(known, found)
    return found[chosen] / known - 1, [labels[n] for n in chosen]


HEAD = ["save", "change", "mode", "its deviation", "modes within 0.1 %"]


def rows() -> list[list[str]]:
    """Rows of the table, see `HEAD`."""
    found = []
    for change in CHANGES:
        error, labels = deviations(change)
        worst = max(error[[one == change.mode for one in labels]], key=abs)
        within = f"{(abs(error) < 1e-3).sum()} of {len(error)}"
        found.append([change.design, change.what, change.mode, percent(worst), within])
    return found


if __name__ == "__main__":
    print("\n".join(table(HEAD, rows(), left=3)))
