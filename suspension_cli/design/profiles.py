"""Measured profiles of fibres: diameter against length, read from CSV and reduced to sections."""

from __future__ import annotations

import math
import os
from itertools import pairwise
from pathlib import Path

from suspension_cli.design import csv_columns
from suspension_cli.design.csv_columns import PER_M, BadTable, split_unit
from suspension_cli.design.units import Raw
from suspension_cli.design.wires import Profile, WireSection
from suspension_cli.errors import Fault, InputError, format_value

EXAMPLES = Path(__file__).parents[1] / "examples"


def resolve_files(raw: Raw, folder: Path) -> None:
    """Read the CSV files of all profiles into a parsed document, in place; raises `InputError`."""
    stages = raw.get("stage")
    faults: list[Fault] = []
    for number, stage in enumerate(stages if isinstance(stages, list) else [], 1):
        if not isinstance(stage, dict):
            continue
        where, wires = f"stage.{stage.get('name', number)}", stage.get("wire")
        tables = {f"{where}.wires": stage.get("wires")}
        if isinstance(wires, list):
            tables |= {f"{where}.wire.{n}": wire for n, wire in enumerate(wires, 1)}
        for path, table in tables.items():
            if not isinstance(table, dict):
                continue
            given = table.get("profile")
            own = {"file": given} if isinstance(given, str) else given
            if not isinstance(own, dict) or "position" in own or "diameter" in own:
                continue
            if isinstance(own.get("file"), str):
                try:
                    table["profile"] = own | _read(_locate(own["file"], folder))
                except BadTable as error:
                    value = format_value(own["file"])
                    faults.append(Fault(f"{path}.profile", error.problem, error.remedy, value))
    if faults:
        raise InputError(faults)


def _locate(name: str, folder: Path) -> Path:
    """Path of a file in a folder, or else among the program's examples."""
    shipped = EXAMPLES / Path(name).name
    return shipped if not os.path.exists(folder / name) and shipped.exists() else folder / name


def _read(file: Path) -> dict[str, list[float]]:
    """Read positions and diameters (m) from a CSV file of two columns."""
    headings, columns = csv_columns.read(file)
    if len(columns) not in (0, 2):
        raise BadTable(f"has {len(columns)} columns", "write position,diameter in each line")
    if not columns or len(columns[0]) < 2:
        raise BadTable("has fewer than two lines of numbers", "measure more places")
    titles = headings if len(headings) == 2 else ["", ""]
    keys = ("position", "diameter")
    return {
        key: [value / split_unit(title, PER_M)[1] for value in column]
        for key, column, title in zip(keys, columns, titles, strict=True)
    }


def reduced(profile: Profile, error: float | None = None) -> list[WireSection]:
    """Reduce a profile to uniform sections, from the upper end.

    Between two places the diameter is linear. Stretches in which it changes by a fraction of at
    most sqrt(error) become one section of the same volume: mass is exact, and means of other powers
    of the radius (compliance, bending stiffness) are wrong by a third to all of `error`.

    Parameters
    ----------
    error
        Instead of that of the profile; 0: one section per pair of places.
    """
    wanted = profile.error if error is None else error
    limit = math.sqrt(wanted)
    sections: list[WireSection] = []
    length = volume = 0.0
    low, high = math.inf, 0.0
    points = zip(profile.position, profile.diameter, strict=True)
    for (top, above), (bottom, below) in pairwise(points):
        # a steep stretch is divided, so that none exceeds the limit
        parts = max(1, math.ceil(abs(math.log(below / above)) / limit)) if wanted else 1
        span = (bottom - top) / parts
        for n in range(parts):
            ends = [above + (below - above) * k / parts for k in (n, n + 1)]
            low, high = min(*ends, low), max(*ends, high)
            if length and (not wanted or high > low * (1 + limit)):
                sections.append(_section(length, volume))
                length = volume = 0.0
                low, high = min(ends), max(ends)
            length += span
            volume += span * (ends[0] ** 2 + ends[0] * ends[1] + ends[1] ** 2) / 3
    return [*sections, _section(length, volume)]


def _section(length: float, volume: float) -> WireSection:
    return WireSection(length=length, radius=math.sqrt(volume / length) / 2)
