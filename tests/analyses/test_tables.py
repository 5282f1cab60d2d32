"""Tables of text: aligned, folded to a terminal, whole in a pipe; rich for them alone."""

from __future__ import annotations

import subprocess
import sys

import pytest

from suspension_cli.analyses import tables
from tests.support.paths import CONFIGS

COLUMNS = {"stage": "", "frequency\nHz": "#.5g", "Q": ".4g", "mode": ""}
ROWS = [
    ("upper", 0.5, 3.1e5, "test pitch 66 %, upper pitch 32 %, test longitudinal 2 %"),
    ("test", 1234.5, 5000.0, "upper yaw 53 %"),
    ("a\nb", "rigid", None, ""),
    ("", float("nan"), float("inf"), "-0.5 [bold]"),
]


def test_numbers_are_aligned_on_the_point():
    lines = tables.render(COLUMNS, ROWS).splitlines()
    assert lines == [
        "  stage   frequency        Q  mode",
        "                 Hz",
        "  upper     0.50000  3.1e+05  test pitch 66 %, upper pitch 32 %, test longitudinal 2 %",
        "  test   1234.5         5000  upper yaw 53 %",
        "  a\\nb        rigid        -",
        "                  -        -  -0.5 [bold]",
    ]


@pytest.mark.parametrize("width", [20, 60, 80, 200])
def test_a_terminal_folds_text_and_no_number(width, monkeypatch):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", str(width))
    monkeypatch.setenv("FORCE_COLOR", "1")
    text = tables.render(COLUMNS, ROWS)
    assert max(map(len, text.splitlines())) <= max(width, 56)
    whole = " ".join(text.split())
    for part in ("0.50000", "1234.5", "3.1e+05", "66 %, upper", "upper yaw 53 %"):
        assert part in whole
    assert "\x1b" not in text and tables.GLUE not in text
    assert (width == 200) == (len(text.splitlines()) == 6)


def test_a_table_without_rows():
    assert tables.render({"mode": "", "Q": ".4g"}, []) == "  mode  Q"


@pytest.mark.parametrize(
    ("options", "imported"), [(["--help"], False), (["--json"], False), ([], True)]
)
def test_rich_is_imported_where_a_table_is_printed(options, imported, tmp_path):
    words = ["modes", CONFIGS / "double.toml", *options]
    words += [] if "--help" in options else ["--fidelity", "string", "--no-plot", "--out", tmp_path]
    code = (
        "import sys\nfrom suspension_cli.cli.main import main\n"
        "try: main()\nfinally: sys.stderr.write(f\"rich {'rich' in sys.modules}\")"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *map(str, words)], capture_output=True, text=True, check=True
    )
    assert done.stderr.endswith(f"rich {imported}")
