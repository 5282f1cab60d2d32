"""Springs, dampers and links that give power to the motion, against a mass on a spring by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tests.support.commandline import assert_refused, document, run, strict_json, written

MASS, STIFFNESS = 2.0, 200.0
BODY = f"""
[design]
name = "active"
[[stage]]
name = "test"
body = {{ mass = {MASS}, inertia = [0.1, 0.1, 0.1] }}
position = [0.0, 0.0, -1.0]
[[stage.spring]]
stiffness = [{STIFFNESS}, 300.0, 400.0, 5.0, 6.0, 7.0]
preload = [0.0, 0.0, {9.81 * MASS}, 0.0, 0.0, 0.0]
"""
LINK = '[[link]]\nname = "servo"\nbetween = ["test", "support"]\n'
DAMPER = '[[damper]]\nname = "brake"\nbetween = ["test", "support"]\n'
TABLE = '[link.table]\naxis = "x"\nfrequency = [0.1, 100.0]\nreal = [[50.0, 50.0]]\n'
# positive diagonal, but x + y is driven
SKEW = [[1.0, -30.0, 0, 0, 0, 0], [-30.0, 1.0, 0, 0, 0, 0], *([[0.0] * 6] * 4)]
ELEMENTS = {
    "damper.brake.damping": DAMPER + "damping = [-4.0, 0, 0, 0, 0, 0]\n{active}",
    "link.servo.damping": LINK + f"stiffness = [0, 0, 0, 0, 0, 1]\ndamping = {SKEW}\n{{active}}",
    "stage.test.spring.1.damping": "damping = [-4.0, 0, 0, 0, 0, 0]\n{active}",
    "link.servo.loss_angle": LINK
    + "stiffness = [-50.0, 0, 0, 0, 0, 1]\nloss_angle = 0.1\n{active}",
    "link.servo.table.imaginary": LINK + "{active}" + TABLE + "imaginary = [[1.0, -10.0]]\n",
}
ACTIVE = "active = true\n"


def oscillator(damping: float = 0.0, stiffness: complex = STIFFNESS) -> complex:
    """Solve m s^2 + c s + k = 0 for the root of largest imaginary part."""
    root = np.sqrt(damping**2 - 4 * MASS * stiffness + 0j)
    return max(((-damping + sign * root) / (2 * MASS) for sign in (1, -1)), key=lambda s: s.imag)


def find_modes(tmp_path: Any, text: str, *more: str) -> Any:
    file = written(tmp_path, BODY + text)
    result = run("modes", file, "--json", "--no-plot", "--out", tmp_path, *more)
    assert result.exit_code == 0
    return strict_json(result.stdout), result.stderr


@pytest.mark.parametrize("key", ELEMENTS)
def test_power_is_refused_unless_meant(tmp_path: Any, key: str) -> None:
    file = written(tmp_path, BODY + ELEMENTS[key].format(active=""))
    (line,) = assert_refused(run("check", file), file)
    assert line.startswith(f"{key} = ") and "active = true" in line
    file = written(tmp_path, BODY + ELEMENTS[key].format(active=ACTIVE))
    found = document("check", file)
    assert found["stable"] is False
    assert any(warning["key"] == key for warning in found["warnings"])


@pytest.mark.parametrize(
    ("text", "pole"),
    [
        (ELEMENTS["damper.brake.damping"], oscillator(-4.0)),
        (ELEMENTS["stage.test.spring.1.damping"], oscillator(-4.0)),
        (LINK + "{active}" + TABLE + "imaginary = [[-10.0, -10.0]]\n", oscillator(0, 250 - 10j)),
        (ELEMENTS["link.servo.loss_angle"], oscillator(0, 150 - 5j)),
    ],
)
def test_growth_is_that_of_one_oscillator(tmp_path: Any, text: str, pole: complex) -> None:
    found, told = find_modes(tmp_path, text.format(active=ACTIVE))
    (mode,) = [mode for mode in found["modes"] if "growth_rate_per_s" in mode]
    assert found["stable"] is False and mode["dof"] == "x"
    assert mode["frequency_hz"] is None and mode["q"] is None
    assert mode["growth_rate_per_s"] == pytest.approx(pole.real, rel=1e-6)
    assert f"oscillating at {abs(pole.imag) / (2 * np.pi):.4g} Hz; make " in told


def test_strong_negative_damping_grows_without_oscillation(tmp_path: Any) -> None:
    text = DAMPER + "damping = [-100.0, 900.0, 0, 0, 0, 0]\n" + ACTIVE
    found, _ = find_modes(tmp_path, text)
    rates = [mode["growth_rate_per_s"] for mode in found["modes"] if "growth_rate_per_s" in mode]
    assert sorted(rates) == pytest.approx(sorted(np.roots([MASS, -100.0, STIFFNESS])), rel=1e-9)
    # the overdamped motion along y keeps both of its poles
    slow = [mode["decay_rate_per_s"] for mode in found["modes"] if "decay_rate_per_s" in mode]
    assert sorted(slow) == pytest.approx(sorted(-np.roots([MASS, 900.0, 300.0])), rel=1e-9)


def test_active_element_that_is_outweighed_is_stable(tmp_path: Any) -> None:
    text = "damping = [4.1, 0, 0, 0, 0, 0]\n" + ELEMENTS["damper.brake.damping"]
    found, told = find_modes(tmp_path, text.format(active=ACTIVE))
    assert found["stable"] is True and "unstable" not in told
    along_x = next(mode for mode in found["modes"] if mode["dof"] == "x")
    assert along_x["q"] == pytest.approx(np.sqrt(MASS * STIFFNESS) / 0.1, rel=1e-5)


@pytest.mark.parametrize(
    "command", [("response",), ("budget",), ("export",), ("xcouple", "--matrix"), ("tolerance",)]
)
def test_no_steady_state_is_computed(tmp_path: Any, command: tuple[str, ...]) -> None:
    spread = '[[tolerance.body]]\nstage = "test"\ncom = {normal = 1e-4}\n'
    text = BODY + ELEMENTS["damper.brake.damping"].format(active=ACTIVE)
    file = written(tmp_path, text + spread)
    (line,) = assert_refused(
        run(command[0], file, *command[1:], "--out", tmp_path / "out"), file, tmp_path / "out"
    )
    assert "test longitudinal grows at 1 1/s, oscillating at 1.584 Hz" in line
    assert "less negative" in line and "--allow-unstable" in line


@pytest.mark.parametrize("level", ["string", "beam"])
@pytest.mark.parametrize(
    ("text", "path", "limit"),
    [
        (ELEMENTS["damper.brake.damping"], "stage.test.damping.x", 4.0),
        # the loss of the table balances c omega, omega^2 = k / m
        (
            LINK + "{active}" + TABLE + "imaginary = [[-10.0, -10.0]]\n",
            "stage.test.damping.x",
            10.0 / math.sqrt(250.0 / MASS),
        ),
    ],
)
def test_builds_follow_the_same_rule(
    tmp_path: Any, level: str, text: str, path: str, limit: float
) -> None:
    file = written(tmp_path, BODY + "[stage.damping]\nx = 0.0\n" + text.format(active=ACTIVE))
    values = ",".join(repr(limit * factor) for factor in (0.5, 0.999, 1.001, 2.0))
    result = run(
        "sweep", file, "--vary", f"{path}={values}", "--result", "test.x/support.x:5",
        "--fidelity", level, "--json", "--out", tmp_path / level,
    )  # fmt: skip
    found = strict_json(result.stdout)["results"][0]
    assert [value is None for value in found["values"]] == [True, True, False, False]
    assert found["nominal"] is None
