"""A measured transfer function, and its prediction from the response of a model.

A channel of gain g, delay t and mix m is ``g exp(-2 pi i f t) (signal + sum m_j other_j)`` in
signals of the design, so a measured transfer function is a sum over elements of the model's
response matrix. The transducers are applied to the model, not to the measured data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.measured import Measured, Transducer, TransferFunction
from suspension_cli.files.declared import in_unit

if TYPE_CHECKING:
    from jaxtyping import Complex, Float


@dataclass(frozen=True)
class MeasuredResponse:
    """A measured transfer function with its uncertainty.

    Attributes
    ----------
    name
        Given, or the stem of the file.
    input, output
        Signals of the design (``"upper.force_x"``, ``"upper.x"``), or the actuator and the sensor
        of the file of measurements; "" if unknown (a bare CSV).
    frequency : (f,) array
        Hz, ascending.
    value : (f,) complex array
        Output over input, in the unit `unit`.
    uncertainty : (f,) array
        Standard deviation of real and imaginary part, in the unit of `value`; NaN where unknown.
    coherence : (f,) array
        From 0 to 1; NaN where not measured.
    unit
        Of `value`: "m/N" once all calibration is applied.
    file
        Where it was read, for errors.
    """

    name: str
    input: str
    output: str
    frequency: Float[np.ndarray, " frequency"] = field(metadata=in_unit("Hz"))
    value: Complex[np.ndarray, " frequency"] = field(metadata=in_unit("{unit}"))
    uncertainty: Float[np.ndarray, " frequency"] = field(metadata=in_unit("{unit}"))
    coherence: Float[np.ndarray, " frequency"]
    unit: str = ""
    file: str = ""


def find_transducer(name: str, among: Sequence[Transducer]) -> Transducer:
    """Find a transducer by name; a signal of the design is its own, of gain 1."""
    return next((one for one in among if one.name == name), Transducer(name="signal", signal=name))


def signals_of(measured: Measured) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """List the signals of the design that the transfer functions depend on.

    With mixed signals, also those fitted from 0 (`mix_uncertainty`).

    Returns
    -------
    inputs, outputs : tuple of str
        Each once, in order of appearance.

    Examples
    --------
    >>> tf = TransferFunction(file="a.csv", input="upper.force_x", output="osem")
    >>> osem = Transducer(name="osem", signal="upper.x", mix={"upper.yaw": 0.1})
    >>> signals_of(Measured(transfer_function=[tf], sensor=[osem]))
    (('upper.force_x',), ('upper.x', 'upper.yaw'))
    """
    inputs = [_signals(tf.input, measured.actuator) for tf in measured.transfer_function]
    outputs = [_signals(tf.output, measured.sensor) for tf in measured.transfer_function]
    return _unique(inputs), _unique(outputs)


def predict(
    measured: Measured,
    tf: TransferFunction,
    frequency: Float[np.ndarray, " frequency"],
    response: Complex[np.ndarray, "*batch frequency output input"],
) -> Complex[np.ndarray, "*batch frequency"]:
    """Predict a measured transfer function from the response of a model.

    Parameters
    ----------
    measured
        With the sensors and actuators.
    tf
        One of `measured`.
    frequency : (f,) array
        Hz, at which `response` is.
    response : (..., f, o, i) array
        Motions over forces or support motions, SI, in the order of ``signals_of(measured)``.

    Returns
    -------
    (..., f) complex array
        Reading per drive.
    """
    inputs, outputs = signals_of(measured)
    drive = channel_weights(find_transducer(tf.input, measured.actuator), inputs, frequency)
    sense = channel_weights(find_transducer(tf.output, measured.sensor), outputs, frequency)
    return np.einsum("fo,...foi,fi->...f", sense, np.asarray(response), drive)


def channel_weights(
    transducer: Transducer,
    signals: Sequence[str],
    frequency: Sequence[float] | Float[np.ndarray, " frequency"],
) -> Complex[np.ndarray, "frequency signal"]:
    """Compute the factor of each signal in a channel.

    Parameters
    ----------
    signals
        At least those of the transducer.
    frequency : (f,) array
        Hz.

    Returns
    -------
    (f, len(signals)) complex array

    Examples
    --------
    >>> osem = Transducer(name="osem", signal="upper.x", gain=2.0, mix={"upper.y": 0.01})
    >>> channel_weights(osem, ["upper.x", "upper.y"], [1.0]).real.tolist()
    [[2.0, 0.02]]
    """
    amount = np.zeros(len(signals))
    for name, value in ((transducer.signal, 1.0), *transducer.mix.items()):
        amount[signals.index(name)] += value
    turn = np.exp(-2j * np.pi * np.asarray(frequency, dtype=float) * transducer.delay)
    return transducer.gain * turn[:, None] * amount


def _signals(name: str, among: Sequence[Transducer]) -> list[str]:
    found = find_transducer(name, among)
    return [found.signal, *found.mix, *found.mix_uncertainty]


def _unique(names: list[list[str]]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name for group in names for name in group))
