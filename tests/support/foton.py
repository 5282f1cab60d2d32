"""Filter files of front ends, written and read without the program."""

from __future__ import annotations

import numpy as np
from scipy import signal


def sections(made):
    """Second-order sections (scipy) of a digital filter of `design.foton`."""
    zeros, poles = (-2 * np.pi * np.array(some) for some in (made.zeros, made.poles))
    gain = made.gain * (2 * np.pi) ** (len(poles) - len(zeros))
    return signal.zpk2sos(*signal.bilinear_zpk(zeros, poles, gain, made.rate))


def bank(module, rate, *rows):
    """Text of a filter file with a section of second-order sections (scipy) each."""
    lines = [f"# MODULES {module}", "#", f"# SAMPLING {module} {rate:g}", ""]
    for index, section in enumerate(rows):
        gain, words = 1.0, []
        for b0, b1, b2, a0, a1, a2 in section.tolist():
            gain *= b0 / a0
            words.append(" ".join(map(repr, (a1 / a0, a2 / a0, b1 / b0, b2 / b0))))
        head = f"{module} {index} 21 {len(section)} 0 0 part {gain!r} "
        lines.append(head + "\n    ".join(words))
    return "\n".join([*lines, ""])
