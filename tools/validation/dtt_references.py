"""Measured transfer functions of KAGRA's suspensions, reduced from files of terrencetec/kontrol.

`python -m tools.validation.dtt_references FOLDER` reads DTT files in a checkout, and writes
`measured/kagra/*.csv`: two or three transfer functions per drive, and how far a repetition of each
was from the first. Between resonances every eighth frequency is kept.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np

from suspension_cli.files import dtt
from suspension_cli.files.whole_files import write_bytes
from tools.tables import ROOT

REPOSITORY = "github.com/terrencetec/kontrol"
DATA = "archive/examples/legacy/data"
LICENCE = "MIT licence, (c) 2020-2023 TSANG Terrence Tak Lun"
REDUCED = {
    "bs-length": ("BS_TML_exc_20200730a", "K1:VIS-BS_TM_LOCK_L_EXC", ("len", "pit", "yaw")),
    "bs-pitch": ("BS_TMP_exc_20200730a", "K1:VIS-BS_TM_LOCK_P_EXC", ("pit", "yaw", "im_pit")),
    "srm-pitch": ("SRM_TMP_200722", "K1:VIS-SRM_TM_TEST_P_EXC", ("pit", "im_pit")),
}
"""File of each drive, its channel, and what is read."""
CHANNELS = {
    "len": "TM_OPLEV_LEN_DIAG",
    "pit": "TM_OPLEV_PIT_DIAG",
    "yaw": "TM_OPLEV_YAW_DIAG",
    "im_pit": "IM_DAMP_P_IN1",
}
BAND = (0.2, 5.0)
RESONANCES = ((0.2, 1.7), (2.6, 2.9), (4.0, 4.4))
"""Bands in Hz whose points are all kept."""
AGAIN = ((0.2, 0.45), (0.45, 0.8), (0.8, 1.3), (1.3, 5.0))
"""Bands in Hz in which both runs on the beam splitter are compared."""
AVERAGES = 5


def read(folder: Path, file: str, drive: str, output: str) -> tuple[np.ndarray, ...]:
    """Frequency (Hz), value and coherence of a transfer function."""
    optic = drive.split("-")[1].split("_")[0]
    found = dtt.read(folder / DATA / f"{file}.xml").columns(
        drive, f"K1:VIS-{optic}_{CHANNELS[output]}"
    )
    return tuple(found.read(found.find("", key)) for key in ("frequency", "value", "coherence"))


def inside(frequency: np.ndarray, *bands: tuple[float, float]) -> np.ndarray:
    """Whether frequencies are in one of some bands."""
    return np.any([(frequency >= low) & (frequency <= high) for low, high in bands], axis=0)


def reduce(folder: Path, name: str, commit: str) -> None:
    """Write one file."""
    file, drive, outputs = REDUCED[name]
    columns: list[np.ndarray] = []
    for output in outputs:
        frequency, value, coherence = read(folder, file, drive, output)
        columns += [value.real, value.imag, coherence]
    kept = inside(frequency, BAND)
    kept &= inside(frequency, *RESONANCES) | (np.arange(len(frequency)) % 8 == 0)
    head = [f"{output}_{part}" for output in outputs for part in ("re", "im", "coherence")]
    lines = [
        f"# Reduced from {DATA}/{file}.xml in {REPOSITORY} at {commit} ({LICENCE}).",
        f"# Per count of {drive}: urad, of len um, as KAGRA's channels are calibrated.",
        ",".join(["frequency", *head]),
    ]
    for row in np.column_stack([frequency, *columns])[kept]:
        cells = [f"{x:.4g}" if n % 3 else f"{x:.6f}" for n, x in enumerate(row[1:], 1)]
        lines.append(",".join([f"{row[0]:.7g}", *cells]))
    write(name, lines)


def repeat(folder: Path, commit: str) -> None:
    """Compare the second run on the beam splitter with the first."""
    lines = [
        f"# Files b over files a of 2020-07-30 in {DATA}, {REPOSITORY} at {commit} ({LICENCE}):",
        "# median ratio, and mean square of the difference over its variance from the coherences,",
        "# of points with a coherence above 0.5 in both.",
        "drive,output,from_hz,to_hz,points,ratio,chi2",
    ]
    for name in ("bs-length", "bs-pitch"):
        file, drive, outputs = REDUCED[name]
        for output in outputs:
            frequency, first, high = read(folder, file, drive, output)
            _, second, other = read(folder, file[:-1] + "b", drive, output)
            variance = sum(
                abs(value) ** 2 * (1 - coherence) / (2 * AVERAGES * coherence)
                for value, coherence in ((first, high), (second, other))
            )
            for band in AGAIN:
                kept = inside(frequency, band) & (np.minimum(high, other) > 0.5)
                chi2 = np.mean(abs(second - first)[kept] ** 2 / variance[kept]) / 2
                ratio = np.median(abs(second / first)[kept])
                cells = [name, output, *map(str, band), str(kept.sum())]
                lines.append(",".join([*cells, f"{ratio:.3f}", f"{chi2:.3g}"]))
    write("repeated", lines)


def write(name: str, lines: list[str]) -> None:
    """Write a file in `measured/kagra/`."""
    target = ROOT / "measured" / "kagra" / f"{name}.csv"
    write_bytes(target, ("\n".join(lines) + "\n").encode())
    print(target.relative_to(ROOT))


def main(folder: Path) -> None:
    """Write all files."""
    git = ["git", "-C", str(folder), "rev-parse", "--short=7", "HEAD"]
    commit = subprocess.run(git, capture_output=True, text=True, check=True).stdout.strip()
    for name in REDUCED:
        reduce(folder, name, commit)
    repeat(folder, commit)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
