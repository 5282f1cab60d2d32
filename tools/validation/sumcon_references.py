"""Designs and reference numbers of KAGRA's suspensions, from a copy of gw-vis/SuspensionModel.

`python -m tools.validation.sumcon_references FOLDER` reads SUMCON's saves and state spaces in a
checkout, and writes `configs/built/kagra-*.toml` and `measured/sumcon/kagra-*.toml`, for SR3 with
the wires that its matrices have. With `--survey` it converts every save and writes
`measured/sumcon/survey.csv`.
"""

from __future__ import annotations

import csv
import hashlib
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np

from suspension_cli.errors import InputError
from suspension_cli.files.whole_files import write_bytes
from suspension_cli.importing import convert
from suspension_cli.importing.imported import table
from suspension_cli.importing.save import read_list
from tools.tables import ROOT
from tools.validation import undamped

REPOSITORY = "github.com/gw-vis/SuspensionModel"
SAVES, SPACES = "models/sumcon/save", "models/sumcon/matlab"
BUILT = {
    "kagra-pr3": ("sumcon_PR3.m", "sus_PR3.m"),
    "kagra-prm": ("sumcon_PRM.m", "sus_PRM.m"),
    "kagra-bs": ("sumcon_BS.m", "sus_BS.m"),
    "kagra-bs-2019": ("reference/TypeB_BS_190803.m", ""),
    "kagra-srm": ("reference/TypeB_SRM_190803.m", ""),
    "kagra-sr3": ("reference/TypeB_SR3_190803.m", ""),
    "kagra-typea": ("sumcon_typeA.m", ""),
}
"""Save of each design, and its state space; without one the matrices in the save itself."""
EDITED = {"kagra-sr3"}
"""Saves whose wires were edited after their matrices were computed."""
OTHER_TENSIONS = {"kagra-srm"}
"""Saves whose matrices have the hinges of tensions that the wires do not carry."""
FREQUENCY = np.geomspace(0.02, 20.0, 31)
AXES = {"x": "z", "y": "x", "z": "y", "roll": "roll", "pitch": "pitch", "yaw": "yaw"}
"""SUMCON's name of each of our coordinates."""
PAIRS = [
    ("support.x", "TM.x"),
    ("support.y", "TM.y"),
    ("support.z", "TM.z"),
    ("support.pitch", "TM.x"),
    ("TM.force_x", "TM.x"),
    ("TM.torque_yaw", "TM.yaw"),
    ("IM.force_x", "TM.x"),
    ("IM.force_z", "TM.z"),
    ("IM.torque_pitch", "TM.pitch"),
    ("IM.torque_yaw", "TM.yaw"),
    ("F0.force_x", "TM.x"),
    ("F2.force_z", "TM.z"),
    ("F2.torque_yaw", "TM.yaw"),
]


class Matrices:
    """Undamped equations of motion: acceleration = -stiffness q - ... for forces and the ground.

    Attributes
    ----------
    names, inputs
        Coordinates; accelerations of the ground (`a...`) and forces (`F...`). SUMCON's names.
    stiffness, drive, ground
        M^-1 K, M^-1 (forces; and -M_pv for accelerations), and M^-1 K_pv, by column.
    """

    def __init__(self, text: str) -> None:
        if "ssA = [" in text:
            a, b = (_matlab(text, name) for name in ("ssA", "ssB"))
            (listed,) = re.findall(r"varinput = \{\.\.\.(.*?)\};", text, re.DOTALL)
            self.inputs = re.findall(r"'(.*?)'", listed)
            self.names = [name[1:] for name in self.inputs if name[0] == "F"]
            held, free = len(self.inputs) - len(self.names), len(self.names)
            rows, at = slice(2 * held + free, None), 2 * held
            self.stiffness = -a[rows, at : at + free]
            self.drive, self.ground = b[rows], -a[rows, :held]
            return
        k, m, k_ground, m_ground = (
            np.array(read_list(text, name), dtype=float)
            for name in ("matKvv", "matMvv", "matKpv", "matMpv")
        )
        names, held = (read_list(text, name) or [] for name in ("allvars", "allparams"))
        self.names = [str(name) for name in names]
        self.inputs = [*(f"a{name}" for name in held), *(f"F{name}" for name in names)]
        self.stiffness, self.ground = np.linalg.solve(m, k), np.linalg.solve(m, k_ground)
        self.drive = np.linalg.solve(m, np.column_stack([-m_ground, np.eye(len(m))]))

    def frequencies(self) -> np.ndarray:
        """Frequencies of the modes, Hz; negative ones are growth rates over 2 pi."""
        square = np.linalg.eigvals(self.stiffness).real
        return np.sort(np.sign(square) * np.sqrt(abs(square)) / 2 / np.pi)

    def respond(self, source: str, output: str) -> np.ndarray | None:
        """Response at `FREQUENCY` between signals of ours; None if SUMCON does not have them."""
        (body, dof), (sink, out) = (one.split(".") for one in (source, output))
        dof = AXES[dof.removeprefix("force_").removeprefix("torque_")]
        name = f"a{dof}g" if body == "support" else f"F{dof}{body}"
        if name not in self.inputs or f"{AXES[out]}{sink}" not in self.names:
            return None
        column, omega = self.inputs.index(name), 2 * np.pi * FREQUENCY
        result = []
        for w in omega:
            load = self.drive[:, column].copy()
            if body == "support":  # of the motion, not of its acceleration
                load = -(w**2) * load - self.ground[:, column]
            result.append(np.linalg.solve(self.stiffness - w**2 * np.eye(len(self.names)), load))
        return np.array(result)[:, self.names.index(f"{AXES[out]}{sink}")]


def _matlab(text: str, name: str) -> np.ndarray:
    (body,) = re.findall(rf"^{name} = \[\.\.\.\n(.*?)\n\];", text, re.DOTALL | re.MULTILINE)
    return np.array([line.split(";")[0].split() for line in body.splitlines()], dtype=float)


def wires_of_the_matrices(text: str, design: str) -> dict[str, float]:
    """Values of a design for the wires in `wirelist`, from which SUMCON derived its matrices.

    Their ends are SUMCON's hinges. The loaded length is the natural one with the tension that the
    wires of the save carry. `design` is the text of the converted design.
    """
    (own,) = re.findall(r"^wirelist = .*?(?=^wirelist /:)", text, re.DOTALL | re.MULTILINE)
    own = re.sub(r"\s*\+\s*hGAS\d", "", own)  # heights of keystones, which have their own place
    own = re.sub(r"[-\d.]+ \+ (\w+)", r"\1", own)
    stages = {stage["name"]: stage for stage in tomllib.loads(design)["stage"]}
    changes: dict[str, float] = {}
    wires = zip(read_list(text, "save$wire") or [], read_list(own, "wirelist") or [], strict=True)
    for saved, derived in wires:
        above, name, _ = str(saved[12]).split("-")
        stage = stages[name]
        on_keystone = "filter" in stages[above] and stage.get("hangs_from") != above
        upper, lower = derived[1][1], derived[3][1]
        natural, k, torsion = derived[4:7]
        stretch = (stage["wires"]["l"] - saved[5]) * stage["wires"]["k"] / k
        path = f"stage.{name}.wires"
        changes |= {f"{path}.l": natural + stretch, f"{path}.k": k, f"{path}.torsion": torsion}
        changes[f"{path}.d"] = lower
        changes |= (
            {f"stage.{above}.filter.at.3": upper} if on_keystone else {f"{path}.d_upper": -upper}
        )
    return {path: float(f"{value:.9g}") for path, value in changes.items()}


def ends_of_wires(design: str) -> dict[str, float]:
    """Lengths of wires and heights of their ends, by dotted path."""
    values: dict[str, float] = {}
    for stage in tomllib.loads(design)["stage"]:
        path = f"stage.{stage['name']}"
        wires = stage.get("wires", {})
        keys = ("l", "d", "d_upper")
        values |= {f"{path}.wires.{key}": wires[key] for key in keys if key in wires}
        if "filter" in stage:
            values[f"{path}.filter.at.3"] = stage["filter"]["at"][2]
    return values


def write(folder: Path, name: str, save: str, space: str, commit: str) -> None:
    """Write a design and its reference numbers."""
    where = f"{REPOSITORY} at {commit[:7]} (MIT licence, (c) 2019 KousekiMiyo)"
    reference = f"{SAVES}/{save} in {where}"
    found = convert.read(folder / SAVES / save, name, reference)
    write_bytes(ROOT / "configs" / "built" / f"{name}.toml", found.text.encode())
    file = f"{SPACES}/{space}" if space else f"{SAVES}/{save}"
    known = Matrices((folder / file).read_text(encoding="utf-8"))
    what = "state space" if space else "stiffness and mass matrices of the save, without heat links"
    lines = [
        "# Numbers of SUMCON's own equations of motion, without damping: modes (negative: growth",
        "# rates over 2 pi) and responses, which are real then.",
        *table("source", {"file": file, "repository": where, "what": what}),
        "",
        "[modes]",
        f"frequency_hz = {np.array2string(known.frequencies(), separator=', ', formatter=NUMBER)}",
        "",
        "[responses]",
        f"frequency_hz = {np.array2string(FREQUENCY, separator=', ', formatter=NUMBER)}",
    ]
    for source, output in PAIRS:
        values = known.respond(source, output)
        if values is not None and abs(values).max() > 0:
            row = np.array2string(values, separator=", ", formatter=NUMBER)
            lines += [f'"{output} / {source}" = {row}']
    changes: dict[str, float] = {}
    if name in EDITED:
        changes = wires_of_the_matrices((folder / file).read_text(encoding="utf-8"), found.text)
    if name in OTHER_TENSIONS:
        hinged = convert.read(folder / SAVES / save, name, reference, bending_points=True)
        changes = ends_of_wires(hinged.text)
    if changes:
        lines += [
            "",
            "[wires_of_the_matrices]  # values of the design between SUMCON's hinges",
            *(f'"{path}" = {value!r}' for path, value in changes.items()),
        ]
    write_bytes(ROOT / "measured" / "sumcon" / f"{name}.toml", "\n".join([*lines, ""]).encode())


NUMBER = {"float_kind": lambda value: f"{value:.9g}" if "." in f"{value:.9g}" else f"{value:.8e}"}


def survey(folder: Path) -> None:
    """Convert every save, and compare its modes with those of the matrices that it contains."""
    rows, seen = [("save", "bodies", "modes", "within 1e-3", "median", "worst", "remark")], set()
    for file in sorted((folder / SAVES).rglob("*.m")):
        data = file.read_bytes()
        if (digest := hashlib.sha256(data).digest()) in seen:
            continue
        seen.add(digest)
        rows.append((str(file.relative_to(folder / SAVES)), *_surveyed(file, folder)))
        print(*rows[-1], flush=True)
    with (ROOT / "measured" / "sumcon" / "survey.csv").open("w", newline="") as stream:
        csv.writer(stream, lineterminator="\n").writerows(rows)


def _surveyed(file: Path, folder: Path) -> tuple[str, ...]:
    tables = folder / "models" / "sumcon" / "HeatLink"
    best: tuple[str, ...] = ()
    for bending_points in (False, True):
        try:
            found = convert.read(file, "survey", tables=tables, bending_points=bending_points)
            design = undamped.parse(found.text)
            ours, _ = undamped.frequencies(undamped.system(design, "string"))
        except InputError as error:
            problem = str(error).splitlines()[0].removeprefix(f"{file}: ")
            best = best or ("", "", "", "", "", problem[:160])
            continue
        try:
            known = Matrices(file.read_text(encoding="utf-8")).frequencies()
        except (InputError, ValueError, TypeError):
            return (
                str(len(design.stage)),
                "",
                "",
                "",
                "",
                "no matrices to compare",
            )
        known = known[known > 1e-3]
        if len(ours) < len(known):
            return str(len(design.stage)), str(len(known)), "", "", "", "unstable modes"
        error = np.abs(ours[undamped.pair(known, ours)] / known - 1)
        own = (str(len(design.stage)), str(len(known)), str(int((error < 1e-3).sum())))
        own = (*own, f"{np.median(error):.1e}", f"{error.max():.1e}")
        if not best or not best[2] or int(own[2]) > int(best[2]):
            best = (*own, "--bending-points" if bending_points else "")
        if error.max() < 1e-3:
            break
    return best


def main(folder: Path, *options: str) -> None:
    """Write all files, or the survey."""
    if "--survey" in options:
        survey(folder)
        return
    git = ["git", "-C", str(folder), "rev-parse", "HEAD"]
    commit = subprocess.run(git, capture_output=True, text=True, check=True).stdout.strip()
    for name, (save, space) in BUILT.items():
        write(folder, name, save, space, commit)


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:])
