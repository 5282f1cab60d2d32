"""Stiffness of terms in frequency, from their functions and matrices."""

from __future__ import annotations

from typing import Any

import numpy as np

from suspension_cli.linear.terms import Term
from suspension_cli.linear.wire_term import WireTerm


def stiffness(term: Term, omega: float) -> Any:
    """What a term adds to the static stiffness at omega (rad/s), among its columns."""
    here: Any = term.at(np.array([omega]))
    functions = here.functions(np.arange(len(term.compact)))
    result = sum((f[0] * a for f, a in zip(functions, term.compact, strict=True)), 0j)
    if isinstance(term, WireTerm):
        row = term.resisted["stretch"][0]
        change = 1 / np.ravel(here.compliance)[0] - term.static_stretching
        result = result + change * row.T @ row
    return result
