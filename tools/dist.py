"""Build the wheel and the source archive into dist/, and try the wheel as a new user would.

    python -m tools.dist         # as `make dist`; needs the packages build and twine
    python -m tools.dist dist    # try the wheel in this folder alone

A wheel is installed into an empty environment, and commands run there in an empty folder. Only
Python's own library is used, so that the second form runs on any system, without make.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import venv
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
CONTENTS = (
    "suspension_cli/py.typed",
    "suspension_cli/__init__.pyi",
    "suspension_cli/design/templates/quad.toml",
    "suspension_cli/examples/geo-silica-triple.toml",
    "suspension_cli/measurements/examples/husman2000/table1.toml",
)
"""Files beside code that both archives must have."""
FROM_PYTHON = """
import suspension_cli as sus
assert "husman2000/table2" in sus.examples()
print(sus.modes(sus.example("geo-silica-triple")))
"""


def build(folder: Path) -> Path:
    """Build both archives, check them, and return the wheel."""
    shutil.rmtree(folder, ignore_errors=True)
    call(sys.executable, "-m", "build", "--outdir", folder, ROOT)
    call(sys.executable, "-m", "twine", "check", "--strict", *folder.iterdir())
    (source,), (wheel,) = folder.glob("*.tar.gz"), folder.glob("*.whl")
    with tarfile.open(source) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    demand(source, names, *CONTENTS, "LICENSE", "CITATION.cff", "CHANGELOG.md")
    return wheel


def demand(archive: Path, names: set[str], *wanted: str) -> None:
    """Fail if an archive lacks one of the wanted files."""
    missing = [name for name in wanted if name not in names]
    if missing:
        raise SystemExit(f"{archive}: no {', '.join(missing)}; check pyproject.toml, MANIFEST.in")


def check_wheel(wheel: Path) -> None:
    """Install a wheel into an empty environment, and design a suspension in an empty folder."""
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    licence = "-".join(wheel.name.split("-")[:2]) + ".dist-info/licenses/LICENSE"
    demand(wheel, names, *CONTENTS, licence)
    with tempfile.TemporaryDirectory(prefix="pendsus-") as name:
        place, folder = Path(name) / "environment", Path(name) / "empty"
        folder.mkdir()
        venv.create(place, with_pip=True)
        programs = place / ("Scripts" if os.name == "nt" else "bin")
        python, pendsus = programs / "python", programs / "pendsus"
        quiet = ("--quiet", "--disable-pip-version-check")
        call(python, "-m", "pip", "install", *quiet, wheel.resolve())
        call(pendsus, "--version", folder=folder)
        call(pendsus, "new", "quad", "my.toml", folder=folder)
        modes = json.loads(call(pendsus, "modes", "my.toml", "--json", folder=folder))["modes"]
        call(pendsus, "report", "my.toml", folder=folder)
        call(python, "-c", FROM_PYTHON, folder=folder)
        written = sorted(path.name for path in (folder / "results").iterdir())
    if len(modes) != 24 or written != ["my-modes.h5", "my-report.html"]:
        raise SystemExit(f"{wheel}: {len(modes)} modes of four bodies, and files {written}")


def call(*words: object, folder: Path | None = None) -> str:
    """Run a command without this checkout on Python's path, and return what it prints."""
    print("$", *words, flush=True)
    clean = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    done = subprocess.run(
        [str(word) for word in words],
        cwd=folder,
        env=clean | {"PYTHONUTF8": "1"},
        stdout=subprocess.PIPE,
        encoding="utf-8",
    )
    if done.returncode:
        print(done.stdout)
        raise SystemExit(done.returncode)
    return done.stdout


def main(folder: str = "") -> None:
    """Try the wheel of a folder, or build the archives and try theirs."""
    (wheel,) = Path(folder).glob("*.whl") if folder else [build(ROOT / "dist")]
    tag = os.environ.get("TAG")
    if tag and tag.removeprefix("v") != wheel.name.split("-")[1]:
        raise SystemExit(f"{wheel}: not the version of the tag {tag}; set it in version.py first")
    check_wheel(wheel)
    print(f"{wheel}: installed and tried")


if __name__ == "__main__":
    main(*sys.argv[1:])
