"""Write `results/validation.md` and its pictures. Run by `make validation`."""

from __future__ import annotations

from suspension_cli.files.whole_files import write_bytes
from tools.tables import ROOT
from tools.validation import geo, kagra, kagra_measured, ligo, measured_losses
from tools.validation.page import percent

SECTIONS = [kagra, kagra_measured, ligo, measured_losses, geo]


def main() -> None:
    """Compute all sections."""
    sections = [module.section() for module in SECTIONS]
    worst = sorted((one for part in sections for one in part.worst), key=lambda one: -abs(one[0]))
    lines = [
        "# Comparison with suspensions that were built",
        "",
        "Designs in `configs/built/` against measurements and other programs, whose numbers are in"
        " `measured/`, each with its source. Deviations are without a fit unless marked as fitted."
        " `make validation` computes the page without a network; fits of KAGRA's measured functions"
        " and their pictures are those of `tools/validation/kagra_measured.py`.",
        "",
        "The three largest deviations:",
        "",
        *(f"- {percent(value)}: {text}" for value, text in worst[:3]),
    ]
    for part in sections:
        lines += ["", f"## {part.title}", "", *part.lines]
    text = "\n".join(lines).replace("\n\n\n", "\n\n").rstrip("\n") + "\n"
    write_bytes(ROOT / "results" / "validation.md", text.encode())
    print("results/validation.md")


if __name__ == "__main__":
    main()
