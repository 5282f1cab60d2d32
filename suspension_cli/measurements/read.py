"""Read measured transfer functions from files of data."""

from __future__ import annotations

from pathlib import Path

from suspension_cli.design.measured import Measured, TransferFunction
from suspension_cli.measurements.transfer_function import MeasuredResponse


def read_all(measured: Measured, file: str | Path) -> list[MeasuredResponse]:
    """Read all transfer functions of a file of measurements, in its order.

    Parameters
    ----------
    measured : Measured
    file : path
        Of the file of measurements: its data files are named from its folder.

    Raises
    ------
    InputError
        With the faults of all data files.
    """
    raise NotImplementedError


def read_transfer_function(table: TransferFunction, folder: str | Path) -> MeasuredResponse:
    """Read one transfer function of a file of measurements.

    Parameters
    ----------
    table : TransferFunction
    folder : path
        From which `table.file` is named.

    Raises
    ------
    InputError
        If the file is at fault, with its line or column.
    """
    raise NotImplementedError
