"""Fits of measured quantities: true values are found again, with the right uncertainties."""

from __future__ import annotations

import math

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.fit import start
from suspension_cli.design import measured
from tests.support.commandline import run, strict_json
from tests.support.legible import assert_legible, said
from tests.support.paths import CONFIGS

DOUBLE = CONFIGS / "double.toml"
OFFSET = '[[perturbation]]\nbody = "test"\ncom_offset = [1e-4, 0.0, 0.0]\n'


def table(name, value, uncertainty):
    return f'[[quantity]]\nname = "{name}"\nvalue = {value!r}\nuncertainty = {uncertainty!r}\n'


def free(name):
    return f'[[parameter]]\nname = "{name}"\n'


def value_of(design, name, level):
    """Value of a quantity, as `compare` prints it."""
    return float(sus.compare(design, design, results=[name], fidelity=level).quantities.value[0, 0])


@pytest.mark.parametrize(
    ("quantity", "path", "change", "level"),
    [
        ("stress test.1", "stage.test.wires.radius", 0.97, "beam"),
        ("tension upper.1", "stage.upper.wires.l", 1.05, "string"),
        ("test static pitch", "stage.test.wires.d", 1.8, "beam"),
        ("Q of test pitch", "stage.test.wires.d", 1.3, "beam"),
        ("test.x/support.x:10", "stage.test.wires.l", 0.93, "beam"),
        ("thermal test.x:10", "stage.test.wires.l", 0.93, "beam"),
        ("lowest pitch", "stage.test.wires.d", 1.4, "beam"),
    ],
)
def test_a_number_is_found_from_one_quantity(quantity, path, change, level, tmp_path):
    """A build differs in one number; one measured scalar of it gives the number again."""
    extra = OFFSET if "static" in quantity else ""
    drawn = sus.parse(DOUBLE.read_text() + extra)
    given = dict(start_values(drawn))[path]
    true = change * given
    value = value_of(drawn.replace({path: true}), quantity, level)
    file = tmp_path / "measured.toml"
    file.write_text(table(quantity, value, 1e-3 * abs(value)) + free(path))
    found = sus.fit(file, drawn, fidelity=level)
    assert found.value[0] == pytest.approx(true, rel=1e-6)
    assert found.chi_squared < 1e-6
    before = value_of(drawn, quantity, level)
    assert found.value_before[0] == pytest.approx(before, rel=1e-9)
    assert found.value_after[0] == pytest.approx(value, rel=1e-6)
    above, below = (
        value_of(drawn.replace({path: true + step}), quantity, level)
        for step in (1e-4 * true, -1e-4 * true)
    )
    slope = (above - below) / (2e-4 * true)
    assert found.sigma[0] == pytest.approx(1e-3 * abs(value / slope), rel=1e-4)


def start_values(design):
    """Paths and values of a design's numbers."""
    from suspension_cli.studies import parameters

    return [(item.name, item.value) for item in parameters.every(design.text)]


def test_the_radius_from_a_stress_is_that_of_the_cross_section(tmp_path):
    """S = T / (pi r^2) with the tension T of `check`; the error of r is half that of S."""
    design = sus.read(DOUBLE)
    [tension, *_] = [one.tension for one in sus.check(design).statics.wires if one.stage == "test"]
    file = tmp_path / "measured.toml"
    file.write_text(table("stress test.1", 4e8, 8e6) + free("stage.test.wires.radius"))
    found = sus.fit(file, design, fidelity="string")
    radius = math.sqrt(tension / (math.pi * 4e8))
    assert found.value[0] == pytest.approx(radius, rel=1e-9)
    assert found.sigma[0] == pytest.approx(radius * 0.02 / 2, rel=1e-4)


def test_modes_and_quantities_weigh_by_their_uncertainties(tmp_path):
    """Two measurements of one number: the weighted mean and its error."""
    design = sus.read(DOUBLE)
    path = "stage.test.wires.d"
    low, high = (design.replace({path: value}) for value in (1.30e-3, 1.32e-3))
    pitch = sus.modes(low, fidelity="string")
    frequency = float(pitch.frequency[list(pitch.label).index("test pitch")])
    q = value_of(high, "top fraction of test pitch", "string")
    lines = [
        f'[[mode]]\nlabel = "test pitch"\nfrequency = {frequency!r}\nuncertainty = 1e-4\n',
        table("top fraction of test pitch", q, 1e-5),
    ]
    ends = []
    for some in (lines[:1], lines[1:], lines):
        file = tmp_path / "measured.toml"
        file.write_text("".join(some) + free(path))
        ends.append(sus.fit(file, design, fidelity="string"))
    weights = np.array([1 / (one.sigma[0] / one.scale) ** 2 for one in ends[:2]])
    mean = (weights[0] * ends[0].value[0] + weights[1] * ends[1].value[0]) / weights.sum()
    assert ends[2].value[0] == pytest.approx(mean, rel=1e-4)
    assert ends[2].sigma[0] / ends[2].scale == pytest.approx(weights.sum() ** -0.5, rel=1e-2)
    assert len(ends[2].label) == len(ends[2].quantity) == 1


def test_two_experiments_share_a_number(tmp_path):
    """The radius follows from Q in two states of the design."""
    file = tmp_path / "joint.toml"
    rows = []
    for name, length in (("short", 0.25), ("long", 0.31)):
        design = sus.read(DOUBLE).replace(
            {"stage.test.wires.l": length, "stage.test.wires.radius": 7.2e-5}
        )
        q = value_of(design, "Q of test longitudinal", "beam")
        rows.append(
            f'[[experiment]]\nname = "{name}"\ndesign = "{DOUBLE}"\n'
            f'set = ["stage.test.wires.l={length}"]\n'
            f'quantity = [{{ name = "Q of test longitudinal", value = {q!r},'
            f" uncertainty = {q / 100!r} }}]\n"
        )
    file.write_text("".join(rows) + free("stage.test.wires.radius"))
    found = sus.fit(file, fidelity="beam")
    assert found.value[0] == pytest.approx(7.2e-5, rel=1e-6)
    assert found.quantities == ("short: Q of test longitudinal", "long: Q of test longitudinal")


def test_beside_transfer_functions(tmp_path):
    """The functions tell d, the stress the radius; both are found together."""
    design = sus.read(DOUBLE)
    true = {"stage.test.wires.d": 1.6e-3, "stage.test.wires.radius": 7.2e-5}
    build = design.replace(true)
    into, out = "upper.torque_pitch", "upper.pitch"
    seen = sus.response(build, inputs=into, outputs=out, frequency="0.3:5:150", fidelity="string")
    rows = [
        f"{f!r},{value.real!r},{value.imag!r}"
        for f, value in zip(seen.frequency.tolist(), seen.value[:, 0, 0].tolist(), strict=True)
    ]
    (tmp_path / "pitch.csv").write_text("\n".join(["frequency,real,imaginary", *rows]))
    stress = value_of(build, "stress test.1", "string")
    text = f'[[transfer_function]]\nfile = "pitch.csv"\ninput = "{into}"\noutput = "{out}"\n'
    text += "uncertainty = 0.02\n" + table("stress test.1", stress, 1e-3 * stress)
    file = tmp_path / "measured.toml"
    file.write_text(text + "".join(free(name) for name in true))
    found = sus.fit(file, design, fidelity="string", explain=False)
    assert found.value == pytest.approx([*true.values()], rel=1e-4)
    assert found.value_residual[0] == pytest.approx(0.0, abs=1e-2)


def test_slopes_of_quantities_are_those_of_modes():
    """The frequency of a mode as a quantity has the analytic derivative of the mode."""
    text = DOUBLE.read_text()
    names = ["stage.test.wires.d", "stage.upper.wires.l", "stage.test.wires.radius"]
    given = measured.Measured(
        mode=[measured.Mode(frequency=1.0, uncertainty=0.1, label="test pitch")],
        quantity=[measured.MeasuredQuantity(name="test pitch", value=1.0, uncertainty=0.1)],
        parameter=[
            measured.Free(name=name, start=1.9e11 if "modulus" in name else None) for name in names
        ],
    )
    problem = start.build([text], given, [""], "beam")
    frequency, slope = problem.predict_modes(problem.base)
    assert problem.predict_values(problem.base) == pytest.approx(frequency, rel=1e-9)
    assert problem.value_slopes(problem.base) == pytest.approx(slope, rel=1e-5)


def test_they_are_printed_stored_and_drawn(tmp_path):
    file = tmp_path / "measured.toml"
    file.write_text(table("stress test.1", 4e8, 8e6) + free("stage.test.wires.radius"))
    done = run("fit", DOUBLE, file, "--fidelity", "string", "--out", tmp_path)
    assert done.exit_code == 0, done.stderr
    [row] = [line for line in done.stdout.splitlines() if "GPa" in line]
    assert row.split()[:5] == ["0.4", "0.008", "0.37469", "0.4", "GPa"]
    stored = sus.load(tmp_path / "double-fit.h5")
    assert stored.quantity == ("stress test.1",) and stored.quantity_unit == ("Pa",)
    assert str(stored) in done.stdout
    figure = stored.plot()
    assert_legible(figure)
    rows = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert [row.split() for row in rows] == [["stress", "test.1", "0.4", "GPa"]]
    assert "1 number fitted to 1 quantity" in said(figure)
    words = ("--fidelity", "string", "--out", tmp_path, "--no-plot", "--json")
    [one] = strict_json(run("fit", DOUBLE, file, *words).stdout)["quantities"]
    assert (one["name"], one["unit"], one["measured"]) == ("stress test.1", "Pa", 4e8)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (table("stress tset.1", 4e8, 8e6), "measured.toml: quantity.1.name"),
        (table("stress test.1", 4e8, -1.0), "uncertainty"),
        (table("test.x/support.x", 1.0, 0.1), "is no response"),
        ('[[quantity]]\nname = "stress test.1"\nuncertainty = 1.0\n', "value: missing"),
    ],
)
def test_faults_are_one_line(text, said, tmp_path):
    file = tmp_path / "measured.toml"
    file.write_text(text + free("stage.test.wires.radius"))
    done = run("fit", DOUBLE, file, "--out", tmp_path)
    assert done.exit_code == 2
    assert done.stderr.count("\n") == 1
    assert said in done.stderr


def test_a_quantity_without_a_value_is_refused(tmp_path):
    """A second mode of an unstable design: there is no frequency to fit."""
    text = (CONFIGS / "husman2000" / "figure6.toml").read_text()
    design = sus.parse(text).replace({"stage.test.wires.s": 0.0, "stage.test.wires.d": -1e-4})
    file = tmp_path / "measured.toml"
    file.write_text(table("test.x/support.x:10", 0.1, 0.01) + free("stage.test.wires.l"))
    with pytest.raises(sus.InputError, match=r"quantity\.1\.name") as raised:
        sus.fit(file, design, fidelity="string")
    assert "has no steady state" in str(raised.value)
