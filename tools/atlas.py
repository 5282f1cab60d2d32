"""The stability atlas: where methods fail, and that what the program does holds.

Writes `results/stability.md` and `.png`.  Run by `make stability`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from stability import beams, blades, couplings, frequency, geometry, masses, modal
from stability.draw import draw
from stability.references import ROOT
from stability.row import BROKEN, SHIPPED, Row

from suspension_cli.plots.style import house, save
from suspension_cli.results import write_bytes

ROWS: dict[str, Callable[[], Row]] = {
    "roll-off": frequency.roll_off,
    "long-chain": frequency.long_chain,
    "beam-functions": beams.row,
    "tiny-couplings": couplings.tiny,
    "large-perturbations": couplings.large,
    "equal-modes": modal.equal_modes,
    "rigid-wires": modal.rigid_wires,
    "rigid-chain": modal.graded_chain,
    "soft-blades": blades.row,
    "soft-pitch": geometry.soft_pitch,
    "narrow": geometry.narrow,
    "slack": geometry.nearly_slack,
    "horizontal": geometry.nearly_horizontal,
    "quality": modal.quality,
    "masses": masses.row,
}
"""Every row of the atlas, in its order."""

HEAD = f"""# Where methods fail

Each row drives one parameter to where methods are known to fail, and compares each with closed forms or arithmetic of 50 digits and more. A method has
broken where it is wrong by more than {100 * BROKEN:g} %, from there on. ε is the rounding of double precision, 1.1 × 10⁻¹⁶. What fails here is written as
people write it (`tools/stability/naive.py`, `tools/stability/energy.py`); what holds is the program, called through its public functions.
`make stability` writes this page, `tests/test_stability.py` pins every row.

![Relative error of each method along the parameter that drives it](stability.png)

| | driven by | other methods break at | largest error of pendsus | its limit, and what it says there |
|---|---|---|---|---|
"""


def power(value: float) -> str:
    """A number of engineering size as it stands, others as a mantissa and a power of ten."""
    if value == 0 or not math.isfinite(value):
        return "0" if value == 0 else "∞"
    if 1e-3 <= abs(value) < 1e4:
        return f"{value:.3g}"
    exponent = math.floor(math.log10(abs(value)))
    mantissa = f"{value / 10.0**exponent:.1f}"
    raised = str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return ("" if mantissa == "1.0" else f"{mantissa.removesuffix('.0')} × ") + f"10{raised}"


def table_row(row: Row) -> str:
    """One line of the table."""
    breaks = [f"{name}: {power(at)}" for name in row.others if (at := row.broken_at(name)) is not None]
    holds = [f"{name}: {_held(row, name)}" for name in row.others if row.broken_at(name) is None]
    ours = [_ours(row, name) for name in row.shipped]
    cells = (f"**{row.title}**", row.driver.replace("|", r"\|"), "<br>".join(breaks + holds), "<br>".join(ours), row.limit)
    return "| " + " | ".join(cells) + " |"


def _held(row: Row, name: str) -> str:
    """What is said of a method that is right in the end, though perhaps not all the way."""
    worst = int(row.error[name].argmax())
    return "holds" if row.worst(name) <= BROKEN else f"off by {power(row.worst(name))} at {power(float(row.value[worst]))}, right beyond"


def _ours(row: Row, name: str) -> str:
    """How far off one of our own methods is: at most, or, where it breaks too, from where on."""
    at, what = row.broken_at(name), name.removeprefix(SHIPPED).removeprefix(":").removeprefix(",").strip()
    found = power(row.worst(name)) if at is None else f"breaks at {power(at)}"
    return f"{what}: {found}" if what else found


def report(rows: list[Row]) -> str:
    """The whole page."""
    sentences = [f"**{row.title}** ({row.quantity}). {row.finding}" for row in rows]
    return HEAD + "\n".join(table_row(row) for row in rows) + "\n\n" + "\n\n".join(sentences) + "\n"


def main() -> None:
    """Work out every row, write the page and draw the chart."""
    rows = []
    for name, make in ROWS.items():
        start = time.perf_counter()
        rows.append(make())
        print(f"{name:20} {time.perf_counter() - start:5.1f} s", flush=True)
    text = report(rows)
    (ROOT / "results").mkdir(exist_ok=True)
    write_bytes(ROOT / "results" / "stability.md", text.encode())
    with house():
        save(draw(rows), ROOT / "results" / "stability.png")


if __name__ == "__main__":
    main()
