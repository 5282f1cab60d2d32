"""Filter files of front ends, written and read without the program."""

from __future__ import annotations

import re

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


def written_response(text, frequency, rate=0.0):
    """Response of a string ``zpk([...],[...],k,"n")`` by the rules of Foton, found in its files.

    Written apart from the program: roots in Hz are divided by their moduli, move to
    rate / pi tan(pi |r| / rate), and an excess of zeros gets poles at rate / pi and turns the sign
    if it is odd.
    """
    zeros, poles, gain = re.fullmatch(r'zpk\(\[(.*)\],\[(.*)\],(.*),"n"\)', text).groups()
    zeros, poles = ([_root(one) for one in some.split(";") if one] for some in (zeros, poles))
    excess, value = max(len(zeros) - len(poles), 0), float(gain) + 0j
    at = 1j * np.asarray(frequency, dtype=float)
    if excess % 2:
        value = -value
    if rate:
        at = 1j * rate / np.pi * np.tan(np.pi * np.asarray(frequency) / rate)
        corner = rate / np.pi * np.tan(1.0)
        if excess % 2:
            value = value / (1 + at / corner)
        value = value / (1 + np.sqrt(2) * at / corner + (at / corner) ** 2) ** (excess // 2)
    for roots, power in ((zeros, 1), (poles, -1)):
        for root in roots:
            if rate and root:
                root *= rate / np.pi * np.tan(np.pi * abs(root) / rate) / abs(root)
            value = value * ((at + root) / (abs(root) or 1.0)) ** power
    return value


def _root(text):
    return complex(re.sub(r"i\*(.*)", r"\1j", text))
