"""Measure speed against accuracy, and write the table, the picture and the page.

`results/tradeoff.csv` has all measurements; `tradeoff.png` and `tradeoff.md` are made from it
alone, also by `python -m tools.tradeoff.page`. Run by `make tradeoff`.
"""

from __future__ import annotations

from suspension_cli.files.whole_files import write_bytes
from tools.tradeoff import many, methods, models, page, peers
from tools.tradeoff.measurement import write_table


def main() -> None:
    """Measure all, store it and write the page."""
    rows = [
        *models.measure_all(),
        *methods.measure_all(),
        *peers.measure_all(),
        *many.measure_all(),
    ]
    write_bytes(page.TABLE, write_table(rows).encode())
    page.main()


if __name__ == "__main__":
    main()
