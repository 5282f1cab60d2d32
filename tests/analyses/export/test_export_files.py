"""What `pendsus export` writes: every format read back is the system that was built, with names,
units, what was measured, and the band in which it is right."""

from __future__ import annotations

import json
import tomllib

import h5py
import numpy as np
import pytest
from scipy.io import loadmat

import suspension_cli as sus
from suspension_cli.analyses.export import solve as export
from suspension_cli.analyses.export.file import FORMATS, python_control
from suspension_cli.design.reader import template
from suspension_cli.files.hdf5 import Provenance, open_results
from suspension_cli.linear import eigenmodes, signals
from tests.support import plants
from tests.support.commandline import run, strict_json, written

MATRICES = ("A", "B", "C", "D")
NAMES = ("state", "state_unit", "input", "input_unit", "output", "output_unit")


@pytest.fixture(scope="module")
def made():
    """A triple with dampers, from support and forces to two bodies."""
    model = plants.model("triple", "force", damping=True)
    inputs, outputs = signals.local_control_signals(model.body)
    return export.build(
        model, export.Opened(plants.drives(model, *inputs), plants.motions(model, *outputs))
    )


@pytest.fixture(scope="module")
def origin():
    return Provenance(
        "[design]\nname = 'triple'\n", "pendsus export triple.toml", "force", "a chain"
    )


def matrices(system):
    return dict(zip(MATRICES, (system.a, system.b, system.c, system.d), strict=True))


def read_mat(path):
    # names are columns of cells
    assert loadmat(path)["pendsus"]["state"][0, 0].shape[1] == 1
    return loadmat(path, simplify_cells=True)["pendsus"]


def read_npz(path):
    with np.load(path, allow_pickle=False) as read:
        return {name: read[name] for name in read.files}


def read_hdf5(path):
    with open_results(path) as file:
        group, axes = file["statespace"], {}
        for name, ends in zip(
            "ABCD", ("state state", "state input", "output state", "output input"), strict=True
        ):
            axes[name] = ends.split()
            assert group[name].attrs["units"]
            assert [axis.label for axis in group[name].dims] == axes[name]
            scales = [next(iter(axis.values())).name for axis in group[name].dims]
            assert scales == [f"/statespace/{axis}" for axis in axes[name]]
        names = {name: group[name].asstr()[:] for name in NAMES}
        return {**file.attrs, **group.attrs, **names, **{name: group[name][:] for name in MATRICES}}


def read_control(path):
    return json.loads(path.read_text())


@pytest.mark.parametrize("read", [read_mat, read_npz, read_hdf5, read_control])
def test_formats(read, made, origin, tmp_path):
    form = read.__name__.removeprefix("read_")
    path = tmp_path / "triple.h5"
    FORMATS[form].write(path, made, origin)
    found = read(path)
    for name, matrix in matrices(made.system).items():
        np.testing.assert_array_equal(found[name], matrix)
    for name in NAMES:
        assert tuple(found[name]) == getattr(made.system, name)
    assert tuple(found["band_hz"]) == made.band
    assert (found["tolerance"], found["worst_error"]) == (made.tolerance, made.worst)
    assert str(found["design"]) == origin.design
    assert (str(found["command"]), str(found["fidelity"])) == (origin.command, origin.fidelity)


def test_zero_pole_gain(origin, tmp_path):
    model = plants.model("triple", "force")
    made = export.build(
        model,
        export.Opened(
            plants.drives(model, "support.x", "support.z"),
            plants.motions(model, "test.x", "test.z@0,0.01,0"),
        ),
        zpk=True,
    )
    path = tmp_path / "triple-zpk.h5"
    FORMATS["zpk"].write(path, made, origin)
    with open_results(path) as file:
        group = file["zpk"]
        np.testing.assert_array_equal(group["gain"][:], made.zpk.gain)
        for o, out in enumerate(("test.x", "test.z@0,0.01,0")):
            for i, into in enumerate(("support.x", "support.z")):
                pair = group[f"{out} from {into}"]
                np.testing.assert_array_equal(pair["zeros"][:], made.zpk.zeros[o][i])
                np.testing.assert_array_equal(pair["poles"][:], made.zpk.poles[o][i])
                assert pair["zeros"].attrs["units"] == pair["poles"].attrs["units"] == "rad/s"


def test_python_control(made):
    control = pytest.importorskip("control")
    system = python_control(made)
    assert isinstance(system, control.StateSpace)
    for name, matrix in matrices(made.system).items():
        np.testing.assert_array_equal(getattr(system, name), matrix)
    for labels, names in (
        (system.state_labels, made.system.state),
        (system.input_labels, made.system.input),
        (system.output_labels, made.system.output),
    ):
        assert labels == [name.replace(".", "_") for name in names]
    poles, own = np.sort_complex(system.poles()), np.sort_complex(np.linalg.eigvals(made.system.a))
    np.testing.assert_allclose(poles, own, rtol=1e-10, atol=1e-9)
    frequency = np.array([0.1, 0.7, 3.3])
    np.testing.assert_allclose(
        np.moveaxis(system(2j * np.pi * frequency), -1, 0),
        made.system.at(frequency),
        rtol=1e-7,
        atol=1e-15,
    )


def test_zero_states_still_have_shapes(origin, tmp_path):
    model = plants.model("triple", "force")
    made = export.build(
        model, export.Opened(plants.drives(model, "support.x"), plants.motions(model, "test.z"))
    )
    for form, name in (("mat", "a.mat"), ("npz", "a.npz"), ("hdf5", "a.h5"), ("control", "a.json")):
        FORMATS[form].write(tmp_path / name, made, origin)
    assert json.loads((tmp_path / "a.json").read_text())["D"] == [[0.0]]
    with np.load(tmp_path / "a.npz") as read:
        assert read["D"].tolist() == [[0.0]]
        assert read["B"].shape == (len(made.system.state), 1)


@pytest.mark.parametrize(
    ("form", "suffix"),
    [(n, one.suffix) for n, one in FORMATS.items() if n not in {"gwinc", "front-end"}],
)
def test_the_command(form, suffix, tmp_path):
    file = written(tmp_path, plants.raw("triple"), "triple.toml")
    signal = ("--input", "support.x", "--output", "test.x")
    result = run("export", file, "--format", form, *signal, "--json", "--out", tmp_path / "out")
    assert result.exit_code == 0, result.stderr
    answer = strict_json(result.stdout)
    path = tmp_path / "out" / f"triple-statespace{suffix}"
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]
    assert answer["file"] == str(path)
    assert (answer["command"], answer["format"], answer["input"], answer["output"]) == (
        "export",
        form,
        ["support.x"],
        ["test.x"],
    )
    frequencies = eigenmodes.solve(plants.model("triple", answer["fidelity"])).frequency
    assert answer["band_hz"] == pytest.approx([frequencies.min() / 100, frequencies.max() * 100])
    assert answer["worst_error"] < answer["tolerance"]
    assert len(answer["state"]) == 12
    if suffix.endswith(".h5"):
        with h5py.File(path) as written_file:
            assert written_file.attrs["format"] == "pendsus"


def test_the_command_takes_all_signals_by_default(tmp_path):
    file = written(tmp_path, plants.raw("five"), "five.toml")
    answer = strict_json(run("export", file, "--json", "--out", tmp_path).stdout)
    assert len(answer["input"]) == 12
    assert answer["output"] == [f"test.{dof}" for dof in ("x", "y", "z", "roll", "pitch", "yaw")]
    assert len(answer["state"]) == 12


DAMPED = plants.CONFIGS / "triple-damped.toml"


@pytest.mark.parametrize("form", ["mat", "control"])
def test_no_band_is_said(form, tmp_path):
    """The pitch of the support moves the upper mass along x by losses alone at most frequencies:
    that response of 144 is more than 1 % off everywhere."""
    arguments = ("export", DAMPED, "--loss", "--format", form, "--out", tmp_path)
    done = run(*arguments)
    assert done.exit_code == 0
    assert (
        "no band" in done.stdout
        and "0 to 0" not in done.stdout
        and "from" not in done.stdout.split("no band")[1].splitlines()[0]
    )
    answer = strict_json(run(*arguments, "--json").stdout)
    assert answer["band_hz"] is None
    assert answer["worst_error"] > 0.01
    if form == "mat":
        assert np.isnan(
            loadmat(tmp_path / "triple-damped-statespace.mat", simplify_cells=True)["pendsus"][
                "band_hz"
            ]
        ).all()
    else:
        written = strict_json((tmp_path / "triple-damped-statespace-control.json").read_text())
        assert written["band_hz"] is None and json.dumps(written, allow_nan=False)


def test_zeros_and_poles_written_are_numbers(tmp_path):
    """Where losses couple y to roll by roundings alone one zero would be at infinity, and the worst
    error NaN."""
    file = plants.CONFIGS / "husman2000" / "triple-vertical.toml"
    signal = ("--input", "support.roll", "--output", "upper.y")
    options = ("--loss", "--format", "zpk", "--json", "--out", tmp_path, *signal)
    answer = strict_json(run("export", file, *options).stdout)
    assert answer["worst_error"] is not None


@pytest.mark.parametrize("output", ["test.x", "test.yaw"])
@pytest.mark.parametrize("error", [0.01, 0.1])
def test_bands_of_agreement_with_wires_that_have_mass(output, error, tmp_path):
    """Where the file departs from `response` on violin, far above the modes."""
    into = f"support.{output[5:]}"
    options = ("--input", into, "--output", output, "--format", "npz", "--out", tmp_path)
    answer = strict_json(run("export", DAMPED, *options, "--json").stdout)["agreement"]
    assert answer["model"] == "violin"
    band = answer["pairs"][0][f"band_hz_{100 * error:g}_percent"]
    with np.load(tmp_path / "triple-damped-statespace.npz") as read:
        a, b, c, d = (read[name] for name in "ABCD")
        ends = [read[f"agreement_{end}_hz"][[0.01, 0.1].index(error)] for end in ("from", "to")]
    assert np.ravel(ends) == pytest.approx(band)
    f = band[1] * np.array([0.9, 1.1])
    made = [(c @ np.linalg.solve(2j * np.pi * at * np.eye(len(a)) - a, b) + d)[0, 0] for at in f]
    design = sus.read(DAMPED)
    found = sus.response(design, inputs=[into], outputs=[output], frequency=f, fidelity="violin")
    inside, beyond = np.abs(made / found.value[:, 0, 0] - 1)
    assert 0.5 * error < inside < error < beyond < 1.5 * error
    lowest = sus.modes(design, fidelity="string").frequency[0]
    assert band[0] < lowest  # resonances and zeros do not interrupt it


@pytest.mark.parametrize("form", ["mat", "hdf5", "control"])
def test_agreement_is_not_known_without_cross_sections(form, tmp_path):
    raw = tomllib.loads(template("single", "single"))
    wires = raw["stage"][0]["wires"]
    del wires["radius"], wires["material"]
    wires["k"] = 4e4
    file = written(tmp_path, raw)
    options = ("export", file, "--format", form, "--out", tmp_path)
    said = run(*options).stdout
    assert "agreement with the violin model" in said
    assert "is not known: wire test.1 has no cross-section; give the material" in said
    answer = strict_json(run(*options, "--json").stdout)["agreement"]
    assert answer["pairs"] is None and "no cross-section" in answer["unknown"]


@pytest.mark.parametrize("loss", [False, True])
@pytest.mark.parametrize("name", ["wire-box", "light-mass", "relaxation1", "wire-1", "upper"])
def test_units_of_states_do_not_depend_on_names_of_stages(name, loss):
    """Stages may be called like the coordinates that losses, wires and light add."""
    design = sus.example("double")
    renamed = sus.parse(design.text.replace('"upper"', f'"{name}"').replace("upper.", f"{name}."))
    how = {"inputs": "support.x", "outputs": "test.x", "loss": loss, "band": "0.1:10"}
    plain, found = (sus.export(one, **how).system for one in (design, renamed))
    assert found.state_unit == plain.state_unit
    unit = dict(zip(found.state, found.state_unit, strict=True))
    assert unit[f"{name}.x"] == "m" and unit[f"{name}.pitch rate"] == "rad/s"
    assert len(unit) == len(found.state)
    assert np.allclose(found.at(np.array([0.3, 3.0])), plain.at(np.array([0.3, 3.0])), rtol=1e-8)
