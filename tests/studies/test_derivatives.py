"""Sensitivities against differences of whole runs, and on resonances."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.named_quantities import names_of
from suspension_cli.design import paths, reader
from suspension_cli.linear import eigenmodes, response, signals
from suspension_cli.models import registry
from suspension_cli.physics.wire_modes import solve_undamped_bodies
from suspension_cli.quantities.kinds.responses import Ratio
from suspension_cli.quantities.nominal_results import find_results
from tests.equilibrium.test_clamps import tables_as_built
from tests.support.golden import CONFIGS
from tests.support.scenes import plain

pytestmark = pytest.mark.filterwarnings("ignore::suspension_cli.errors.PendsusWarning")

DOUBLE = CONFIGS / "double.toml"


def beam(text, *overrides):
    """Linear model and modes of a design read anew."""
    model = registry.BEAM.system(reader.parse_with_overrides(text, overrides))
    return model, eigenmodes.solve(replace(model, terms=()))


@cache
def solved(text, *results, level="beam"):
    names = names_of(reader.Source(reader.parse(text), text, ""))
    requested = find_results(results, names, text, level)
    found = sus.sensitivity(sus.parse(text), results=results, fidelity=level, allow_unstable=True)
    return found, requested


def whole_run(text, level, requested, numbers):
    """All modes, then the sizes of responses, of a design with numbers put in."""
    overrides = paths.symmetric_settings(numbers)
    model = registry.by_name(level).system(reader.parse_with_overrides(text, overrides))
    known, sizes = signals.bodies_with_signals(model), []
    for item in (item for item in requested if isinstance(item, Ratio)):
        outputs = [
            signals.parse_output(s.text, known) for s in (item.over, item.under) if s is not None
        ]
        y = response.solve(model, np.array([item.frequency]), [item.input], outputs).value[0, :, 0]
        sizes.append(abs(y[0] if len(y) == 1 else y[0] / y[1]))
    return np.array([*solve_undamped_bodies(model).frequency, *sizes])


def sectioned():
    """Thick ends and a taper, in gas."""
    raw = tomllib.loads(DOUBLE.read_text())
    del (wires := raw["stage"][1]["wires"])["radius"]
    wires["sections"] = [
        {"radius": 120e-6, "length": 0.01},
        {"radius": [75e-6, 70e-6], "steps": 2},
        {"radius": 110e-6, "length": 0.012},
    ]
    wires["d"] = wires["d_upper"] = 0.002
    return reader.write_toml(raw | {"gas": {"pressure": 1e-3}})


def heavy():
    """Wires of 1 mm, whose mass and stiffness matter."""
    raw = tomllib.loads((CONFIGS / "husman2000" / "table1-case2.toml").read_text())
    raw["stage"][0]["wires"]["radius"] = 1e-3
    return reader.write_toml(raw)


COUPLING = "test.x@0,0,-0.001/test.z@0,0,-0.001/support.z:50"
CASES = {
    "triple-tolerance": (
        ("string", "beam"),
        ["test.x/support.x:3", "test.pitch/test.x@0,0,0.001/support.x:9"],
    ),
    "quadruple": (("beam",), ["test.x@0,0,0.001/support.x:10"]),
    "tower": (("beam",), ["mirror.x/support.x:1"]),
    "cryogenic-payload": (("string",), ["mirror.x/ground.x:1.3"]),
    "imperfect": (("string", "beam"), [COUPLING, "test.z/test.force_z@0.01,0,0:5"]),
    "payload-recoil-mass": (("string",), ["mirror.pitch/support.x:3"]),
    "five-wires": (("beam",), []),
    "triple-damped": (("beam",), ["test.x/support.x:0.6"]),
    "sections": (("beam",), ["test.x/support.x:10", "test.pitch/test.x/support.x:20"]),
    "heavy": (("violin",), ["test.x/support.x:150"]),
    "bending points": (("beam",), ["test.x/support.x:2"]),
    "tilted": (("string",), ["test.x/support.x:2"]),
}
MADE = {
    "sections": sectioned,
    "heavy": heavy,
    "bending points": lambda: reader.write_toml(plain(tables_as_built("lopsided", (0.01, 0, 0)))),
    "tilted": lambda: reader.write_toml(
        tomllib.loads((CONFIGS / "triple-damped.toml").read_text()) | {"constants": TILTED}
    ),
}
TILTED = {"gravity": [0.3, -0.2, -9.7], "gravity_gradient": 2e-4, "wire_weight": True}


@pytest.mark.parametrize(
    ("case", "level"), [(case, level) for case, (levels, _) in CASES.items() for level in levels]
)
def test_against_richardson_extrapolation_of_whole_runs(case, level):
    """Equilibria that move, blades, clamps, sections, losses, dampers, points of bodies that turn:
    five-point differences of runs of the program, each design read anew.

    All numbers are changed at once, by random shares of each: a derivative that is wrong in any of
    them shows. Errors are relative to the largest derivative of each result.
    """
    text = MADE[case]() if case in MADE else (CONFIGS / f"{case}.toml").read_text()
    found, requested = solved(text, "modes", *CASES[case][1], level=level)
    # moduli that are set as numbers depend on temperature no longer
    cold = np.array([name.endswith("temperature") for name in found.parameter])
    chosen = np.flatnonzero(found.free & (found.value != 0) & ~cold)
    rng = np.random.default_rng(3)
    shares = rng.uniform(0.5, 1, len(chosen)) * rng.choice([-1, 1], len(chosen))
    change = found.value[chosen] * shares

    def run_at(share):
        values = (found.value[chosen] + share * change).tolist()
        names = [found.parameter[n] for n in chosen]
        return whole_run(text, level, requested, dict(zip(names, values, strict=True)))

    step = 1e-4 if level == "violin" else 1e-5
    sides = [run_at(n * step) - run_at(-n * step) for n in (1, 2)]
    expected = (8 * sides[0] - sides[1]) / (12 * step)
    each = change[:, None] * found.derivative[chosen]
    # derivatives of degenerate modes by several numbers add up in the mean alone
    same = np.abs(found.nominal[:, None] / found.nominal - 1) < 1e-6
    error = same @ (each.sum(0) - expected) / same.sum(1) / np.abs(each).max(0)
    assert np.abs(error).max() < 1e-6


def test_numbers_that_only_wires_that_bend_know():
    """A wire of given k pulls as a string whatever its radius; on beam EI goes with r^4 and GJ with
    E/(1 + nu), so E and r count by E r^4. Only the tension's part of torsion, T r^2/2 in yaw, goes
    with r^2."""
    raw = tomllib.loads(DOUBLE.read_text())
    raw["stage"][1]["wires"] |= {"k": 13000.0}
    raw["stage"][0]["wires"] |= {"k": 50000.0}
    text = reader.write_toml(raw)
    string, bent = (solved(text, "modes", level=level)[0] for level in ("string", "beam"))
    radii, modulus = (
        [f"stage.{name}.wires.radius" for name in ("upper", "test")],
        "materials.c70steel.youngs_modulus",
    )
    assert not {*radii, modulus} & set(string.parameter)
    share = dict(zip(bent.parameter, bent.one_percent, strict=True))
    assert share[modulus][bent.result.index("test pitch")] > 0.05
    yaw = bent.result.index("upper yaw")
    tensioned = sum(share[name] for name in radii) - 4 * share[modulus]
    turning = np.array(["yaw" in name for name in bent.result])
    np.testing.assert_allclose(
        tensioned[~turning], 0.0, atol=1e-6 * np.abs(4 * share[modulus]).max()
    )
    assert (tensioned[turning] > 1e-7).all()
    twist = share["materials.c70steel.poisson_ratio"]
    assert twist[yaw] < -1e-4 and abs(twist[bent.result.index("test longitudinal")]) < 1e-6


def test_on_a_resonance_and_a_coupling_that_is_zero():
    """Half a line's width from the top of a peak, where steps of all but the smallest size would
    lead over it: against such small steps. A coupling that is zero cannot grow by what keeps the
    symmetry."""
    text, name = DOUBLE.read_text(), "stage.test.wires.l"
    model, _ = beam(text)
    states = eigenmodes.solve(model)
    quality, peak = float(states.q[1]), float(states.frequency[1])
    assert quality > 1e3
    found, requested = solved(
        text, "test.z/test.x/support.x:5", f"test.x/support.x:{peak * (1 + 0.5 / quality)!r}"
    )
    assert found.nominal[0] == 0 and not found.derivative[:, 0].any()
    value, step = 0.28, 0.28 * 0.02 / quality
    low, high = (
        whole_run(text, "beam", requested, {name: value + sign * step})[-1] for sign in (-1, 1)
    )
    slope = found.derivative[found.parameter.index(name), 1]
    assert abs(slope) * value > 0.05 * quality * found.nominal[1]
    assert slope == pytest.approx((high - low) / (2 * step), rel=1e-3)
