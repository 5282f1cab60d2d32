"""Transfer functions from text, HDF5 and DTT XML, and what is wrong with such files."""

from __future__ import annotations

import gzip
from pathlib import Path

import h5py
import numpy as np
import pytest

from suspension_cli.design import measured
from suspension_cli.design.measured import Measured, TransferFunction
from suspension_cli.errors import InputError
from suspension_cli.measurements.read import read_all, read_bare
from tests.support.dtt_files import document, result

F = np.array([0.5, 1.0, 2.0])
H = np.array([1.0 + 2.0j, -3.0 + 0.5j, 0.25j])


def written(folder: Path, text: str, name: str = "data.csv") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def table(delimiter: str, *columns: np.ndarray) -> str:
    return "".join(
        delimiter.join(f"{value:.17g}" for value in row) + "\n"
        for row in zip(*columns, strict=True)
    )


def read(path: Path, **keys):
    table = TransferFunction(file=path.name, input="upper.force_x", output="upper.x", **keys)
    return read_all(Measured(transfer_function=[table]), path)[0]


@pytest.mark.parametrize(
    ("heading", "delimiter", "columns", "keys"),
    [
        ("f, re, im\n", ", ", (F, H.real, H.imag), {}),
        ("# made today\n# freq [Hz]\tReal\tImag\n", "\t", (F, H.real, H.imag), {}),
        ("f_mHz,re,im\n", ",", (1e3 * F, H.real, H.imag), {}),
        ("Frequency (Hz);mag_dB;phase (deg)\n", ";", "dB", {}),
        ("% omega mag phase_rad\n", " ", "rad", {}),
        ("", " ", (H.imag, F, H.real), {"frequency": 2, "real": 3, "imaginary": 1}),
        ("a,b,c\n", ",", (F, H.real, H.imag), {"frequency": "a", "real": "b", "imaginary": "c"}),
        ("a,b,c\n", ",", "rad", {"frequency": 1, "magnitude": 2, "phase": 3,
                                "frequency_unit": "rad/s", "phase_unit": "rad"}),
    ],
)  # fmt: skip
def test_text(heading, delimiter, columns, keys, tmp_path):
    if columns == "dB":
        columns = (F, 20 * np.log10(np.abs(H)), np.degrees(np.angle(H)) + 360)
    elif columns == "rad":
        columns = (2 * np.pi * F, np.abs(H), np.angle(H))
    found = read(written(tmp_path, heading + table(delimiter, *columns)), **keys)
    assert np.allclose(found.frequency, F, rtol=1e-14)
    assert np.allclose(found.value, H, rtol=1e-13)
    assert np.isnan(found.uncertainty).all() and found.unit == "m/N" and found.name == "data"


@pytest.mark.parametrize("heading", [None, "f  H", "frequency  anything"])
def test_text_of_complex_numbers(heading, tmp_path):
    """As people write them, and as numpy does, which makes the frequency complex, too."""
    frequency = np.array([0.1, 0.5, 2.0])
    value = np.array([1.02 + 0.3j, -1.5 - 0.2j, 3e-4 + 2e-5j])
    lines = [f"{f} {h.real}{h.imag:+}j" for f, h in zip(frequency, value, strict=True)]
    file = tmp_path / "plain.txt"
    file.write_text("\n".join([*([heading] if heading else []), *lines]))
    np.savetxt(tmp_path / "numpy.txt", np.stack([frequency, value], axis=1), header=heading or "")
    for path in (file, tmp_path / "numpy.txt"):
        (found,) = read_bare(path)
        np.testing.assert_array_equal(found.frequency, frequency)
        np.testing.assert_allclose(found.value, value, rtol=1e-15)


def test_uncertainty_gain_and_band(tmp_path):
    """A relative number; a column; coherence and averages: all scale with the gain."""
    file = written(
        tmp_path, "f,re,im,coh,sigma\n" + table(",", F, H.real, H.imag, [0.5, 0.8, 1.0], [1, 2, 3])
    )
    coherent = read(file, gain=-1e-6, averages=50, uncertainty=None)
    assert np.allclose(coherent.uncertainty, 1e-6 * np.array([1, 2, 3]))
    assert np.allclose(coherent.value, -1e-6 * H)
    assert np.allclose(read(file, gain=2.0, uncertainty=0.1).uncertainty, 0.2 * np.abs(H))
    file = written(tmp_path, "f,re,im,coh\n" + table(",", F, H.real, H.imag, [0.5, 0.8, 1.0]))
    found = read(file, averages=50, band=[0.9, 3.0])
    assert found.frequency.tolist() == [1.0, 2.0]
    assert np.isclose(found.uncertainty[0], abs(H[1]) * np.sqrt(0.2 / (100 * 0.8)))
    assert np.isnan(found.uncertainty[1])  # a coherence of 1 says nothing of the noise
    decibels = written(tmp_path, "f,db,deg,sigma\n1,20,0,0.1\n")
    assert np.isclose(read(decibels).uncertainty[0], 10 * (10 ** (0.1 / 20) - 1), rtol=1e-2)


def test_scatter_of_simulated_spectra(tmp_path):
    """The formula of coherence and averages against the scatter of estimated transfer functions."""
    random = np.random.default_rng(5)
    trials, averages, noise = 4000, 40, 0.7
    x, n = random.normal(size=(2, trials, averages, 2)) @ [1, 1j]
    y = 2.0 * x + noise * n
    xx, yy = (np.mean(np.abs(s) ** 2, 1) for s in (x, y))
    xy = np.mean(np.conj(x) * y, 1)
    file = written(
        tmp_path,
        "f,re,im,coh\n" + table(",", [1.0], [2.0], [0.0], [np.mean(np.abs(xy) ** 2 / (xx * yy))]),
    )
    sigma = read(file, averages=averages).uncertainty[0]
    assert np.isclose(np.std((xy / xx).real), sigma, rtol=0.05)
    assert np.isclose(np.std((xy / xx).imag), sigma, rtol=0.05)


def test_hdf5(tmp_path):
    file = tmp_path / "data.h5"
    with h5py.File(file, "w") as stored:
        stored["m/frequency"], stored["m/tf"], stored["m/coh"] = F, H, [0.5, 0.5, 0.5]
        stored["m/re"], stored["short"] = H.real, F[:2]
    keys = {"frequency": "m/frequency", "value": "m/tf", "coherence": "m/coh", "averages": 10}
    found = read(file, **keys)
    assert (found.value == H).all() and np.allclose(found.uncertainty, np.abs(H) * 0.05**0.5)
    assert refusal(file, **(keys | {"value": "m/ft"})).startswith(
        "value = \"m/ft\": names no dataset; did you mean 'm/tf'?"
    )
    assert "lengths differ" in refusal(file, **(keys | {"frequency": "short"}))


@pytest.mark.parametrize("order", ["<", ">"])
def test_dtt_transfer_functions(order, tmp_path):
    """All forms of transfer functions and coherences, in both byte orders."""
    n = np.arange(3)
    grid, other, coherence = 0.25 * n, 2 * H, np.array([[0.5] * 3, [0.9] * 3])
    for subtypes, frequency in (((0, 2), None), ((3, 5), F[::-1]), ((6, 7), F[::-1])):
        file = written(
            tmp_path,
            document(
                result(0, "TransferFunction", subtypes[0], [H, other], ["EXC", "S1", "S2"],
                       frequency=frequency, order=order),
                result(1, "TransferFunction", subtypes[1], coherence, ["EXC", "S1", "S2"],
                       frequency=frequency, order=order),
            ),
            "sweep.xml",
        )  # fmt: skip
        found = read(file, input_channel="EXC", output_channel="S2")
        expected = (grid[1:], other[1:]) if frequency is None else (F, other[::-1])
        assert np.allclose(found.frequency, expected[0]) and np.allclose(found.value, expected[1])
        assert np.allclose(found.coherence, 0.9)
        assert np.allclose(found.uncertainty, np.abs(found.value) * (0.1 / 18) ** 0.5)
    assert [(one.input, one.output) for one in read_bare(file)] == [("EXC", "S1"), ("EXC", "S2")]


def test_dtt_spectra(tmp_path):
    """B/A of spectra: conj(P_AB) / ASD_A^2, both ways, of compressed files as well."""
    a, b = np.array([9.0, 2.0, 3.0]), np.array([9j, 4j, -3.0])  # the first at 0 Hz
    text = document(
        result(0, "Spectrum", 1, np.abs(a), ["A"]),
        result(1, "Spectrum", 1, np.abs(b), ["B"]),
        result(2, "Spectrum", 2, a * np.conj(b), ["A", "B"]),
        result(3, "Spectrum", 3, np.array([0.5, 0.5, 0.5]), ["A", "B"]),
    )
    for name in ("fft.xml", "fft.xml.gz"):
        (tmp_path / name).write_bytes(
            gzip.compress(text.encode()) if "gz" in name else text.encode()
        )
        for into, out, expected in (("A", "B", b / a), ("B", "A", a / b)):
            found = read(tmp_path / name, input_channel=into, output_channel=out)
            assert np.allclose(found.value, expected[1:]) and found.coherence[0] == 0.5
            assert found.frequency.tolist() == [0.25, 0.5]


def refusal(path: Path, **keys) -> str:
    with pytest.raises(InputError) as raised:
        read(path, **keys)
    line = str(raised.value)
    assert line.startswith(f"{path}: ") and "\n" not in line and "; " in line
    return line.removeprefix(f"{path}: ")


HEAD = "f,re,im\n"


@pytest.mark.parametrize(
    ("text", "keys", "says"),
    [
        ("", {}, "is empty"),
        (HEAD, {}, "has no numbers"),
        (HEAD + "1,2,3\n2,x,3\n", {}, 'line 3: "x" is not a number'),
        (HEAD + "1,2,3\n2,3\n", {}, "line 3: has 2 columns, but line 2 has 3"),
        ("f,re\n1,2,3\n", {}, "line 1: has 2 headings for 3 columns"),
        (HEAD + "1,2,3\n\n# pause\n1,2,3\n", {}, "line 5: the frequency 1 is given twice"),
        (HEAD + "1,2,3\n0.5,2,3\n", {}, "line 3: the frequency 0.5 follows 1; sort by"),
        (HEAD + "-1,2,3\n", {}, "line 2: the frequency -1 is below 0"),
        (HEAD + "1,2,nan\n", {}, "line 2: the value at 1 Hz is no number"),
        (HEAD + "1,2,3\n", {"real": "rel"}, 'real = "rel": names no column; did you mean \'re\'?'),
        (HEAD + "1,2,3\n", {"real": 4}, "real = 4: names no column; the file has columns 1 to 3"),
        ("1,2,3\n", {}, "frequency: no column of frequencies is recognised (it has no headings)"),
        ("f,mag\n1,2\n", {}, 'magnitude = "mag": a transfer function needs the phase, too'),
        ("f,re\n1,2\n", {}, 'real = "re": a transfer function needs the imaginary, too'),
        ("f,a,b\n1,2,3\n", {}, "real: no columns of values are recognised (found here: f, a, b)"),
        ("f,re,im,coh\n1,2,3,1.2\n", {}, "line 2: the coherence 1.2 is above 1; name another"),
        ("f,mag,phase\n1,2,3e4\n", {}, "line 2: the phase 30000 is above 10000"),
        (HEAD + "1,2,3\n2,1e300,0\n", {}, "line 3: the value at 2 Hz is no number below 1e+100"),
        ("f,db,phase\n1,1e9,0\n", {}, "line 2: the value at 1 Hz is no number below 1e+100"),
        ("f,mag,phase\n1,-20,3\n", {}, "line 2: the magnitude -20 is below 0; write"),
        ("f (1/h),re,im\n1,2,3\n", {}, 'has the column "f (1/h)", whose unit is not'),
        (HEAD + "1,2,3\n", {"band": [5.0, 9.0]}, "band: no point lies in the band 5 to 9 Hz"),
        (HEAD + "1,2,3\n", {"input_channel": "A"}, "input_channel = A: is for XML"),
        ("f,re,im,sigma\n1,2,3,-1\n", {}, "line 2: the standard deviation -1 is below 0"),
        ("<html></html>", {}, 'is XML of "html", not of the diagnostics test tools'),
        ("<html>", {}, "is not XML"),
        (document(), {}, "has no results of the diagnostics test tools"),
        (document(result(0, "Spectrum", 1, F, ["A"])), {}, "has no transfer function"),
        (
            document(result(0, "TransferFunction", 0, H, ["H1:EXC", "H1:OUT"])),
            {"input_channel": "H1:EXCI"},
            'input_channel = "H1:EXCI": is the input of no transfer function in the file; did you'
            " mean 'H1:EXC'?",
        ),
        (
            document(result(0, "TransferFunction", 0, [H, H], ["A", "B", "C"])),
            {"input_channel": "A"},
            "output_channel: the file has 2 transfer functions, from A to B, C",
        ),
        (
            document(result(0, "TransferFunction", 3, [H, H], ["A", "B", "C"])),
            {"input_channel": "A"},
            "Result[0]: cannot be read (the stream has 48 bytes, 72 or 144 are needed)",
        ),
        (
            document(
                result(0, "TransferFunction", 3, H, ["A", "B"], frequency=[1.0, 2.0, 2.0])
            ),
            {},
            "point 3 of B/A: the frequency 2 is given twice",
        ),
    ],
)  # fmt: skip
def test_faulty_file(text, keys, says, tmp_path):
    name = "data.xml" if text.startswith("<") else "data.csv"
    assert refusal(written(tmp_path, text, name), **keys).startswith(says)


def test_missing_and_foreign_files(tmp_path):
    assert refusal(tmp_path / "no.csv").startswith("cannot be read (No such file")
    assert refusal(written(tmp_path, "text", "a.h5")).startswith("is not HDF5")
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00")
    assert refusal(tmp_path / "b.csv").startswith("is not text")


def test_file_of_measurements(tmp_path):
    """Names, units and all faults of a file at once."""
    text = """
[[transfer_function]]
file = "data.csv"
input = "coil"
output = "upper.yaw"
[[transfer_function]]
file = "data.csv"
input = "coil"
output = "osem"
[[actuator]]
name = "coil"
signal = "upper.torque_yaw"
[[sensor]]
name = "osem"
signal = "upper.x"
unit = "V"
"""
    file = written(tmp_path, text, "m.toml")
    data = written(tmp_path, HEAD + "1,2,3\n")
    found = read_all(measured.read(file), file)
    assert [one.name for one in found] == ["data upper.yaw/coil", "data osem/coil"]
    assert [one.unit for one in found] == ["rad/(N m)", "V/(N m)"]
    data.unlink()
    with pytest.raises(InputError, match="cannot be read"):
        read_all(measured.read(file), file)
    spoilt = text.replace('input = "coil"', 'input = "coli"').replace("upper.x", "x")
    with pytest.raises(InputError) as raised:
        measured.read(written(tmp_path, spoilt, "n.toml"))
    assert len(raised.value.faults) == 3
    assert "did you mean 'coil'?" in str(raised.value)


def test_series_of_gwpy(tmp_path):
    """A FrequencySeries is one dataset, whose attributes give the first frequency and the step."""
    value = np.array([1 + 2j, 3 - 1j, 0.5j])
    with h5py.File(tmp_path / "a.h5", "w") as file:
        series = file.create_dataset("H1:SUS-ETMX_M0_DAMP_L_OUT", data=value)
        series.attrs.update(x0=0.5, dx=0.25, unit="m", channel="H1:SUS-ETMX_M0_DAMP_L_OUT")
    [one] = read_bare(tmp_path / "a.h5", input="upper.force_x", output="upper.x")
    assert one.frequency.tolist() == [0.5, 0.75, 1.0]
    assert one.value.tolist() == value.tolist()
