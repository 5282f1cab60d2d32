"""XML files as the LIGO diagnostics test tools save them, of given numbers."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np


def result(
    number: int,
    kind: str,
    subtype: int,
    values: Any,
    channels: Sequence[str],
    *,
    frequency: Any = None,
    order: str = "<",
    averages: int = 10,
) -> str:
    """One result: `values` (M, N) at f0 + n df, or preceded by `frequency`."""
    values = np.atleast_2d(values)
    complex_values = np.iscomplexobj(values)
    kinds = f"{order}c8" if complex_values else f"{order}f4"
    data = values.astype(kinds).tobytes()
    if frequency is not None:
        double = kind == "TransferFunction" and subtype in (6, 7)
        data = np.asarray(frequency).astype(f"{order}f8" if double else kinds).tobytes() + data
    first, *others = channels
    names = "".join(
        f'<Param Name="ChannelB[{n}]" Type="string">{name}</Param>' for n, name in enumerate(others)
    )
    encoding = {"<": "LittleEndian", ">": "BigEndian"}[order]
    parameters = {
        "Subtype": subtype,
        "f0": 0.0,
        "df": 0.25,
        "N": values.shape[1],
        "M": values.shape[0],
        "Averages": averages,
        "ChannelA": first,
    }
    written = "".join(f'<Param Name="{key}">{value}</Param>' for key, value in parameters.items())
    return (
        f'<LIGO_LW Name="Result[{number}]" Type="{kind}">{written}{names}<Array Type="float">'
        f'<Dim>1</Dim><Stream Encoding="{encoding},base64">\n'
        f"{base64.encodebytes(data).decode()}</Stream></Array></LIGO_LW>"
    )


def document(*results: str) -> str:
    """A whole file."""
    return (
        '<?xml version="1.0"?>\n<!DOCTYPE LIGO_LW [\n<!ELEMENT LIGO_LW (Param)*>\n]>\n'
        f'<LIGO_LW Name="Diagnostics Test">{"".join(results)}</LIGO_LW>\n'
    )
