"""Modes that are far apart, nearly equal, or weakly damped."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mpmath
import numpy as np

from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import damped, eigenmodes, signals, statespace
from suspension_cli.linear.structure import Structure
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.models import string as string_model
from tools.stability import naive
from tools.stability.references import (
    INERTIA,
    MASS,
    SHAPE,
    design,
    document,
    given_omega_squared,
    omega_squared,
    stage,
)
from tools.stability.row import SHIPPED, Row, relative, sample

STIFFNESS_RATIO = 10.0 ** np.arange(1, 16)
DETUNING = 2 * 10.0 ** np.arange(0, -16, -1)
LOSS = 10.0 ** np.arange(-2, -15, -1)
SOFT = 2
"""Number of modes restored by tension alone: longitudinal and transverse."""
TENSION = MASS * 9.81 / 4
CHAIN = 4


def rigid_wires(ratio: Any = STIFFNESS_RATIO) -> Row:
    """Compute errors of soft modes on wires `ratio` times stiffer along than across."""
    error: dict[str, Any] = {}
    for kind, more in (("", {}), (", wires at 3°", {"t1": 0.0815})):

        def compute(value: float, kind: str = kind, more: Any = more) -> Any:
            k = float(value * TENSION / SHAPE["l"])
            model = registry.STRING.system(design(document(k=k, **more)))
            reference = np.array(
                [float(v) for v in omega_squared(stage(shape={"k": k, **more}))[:SOFT]]
            )
            found = {f"{SHIPPED}{kind}": np.sort(eigenmodes.solve(model).omega_squared)[:SOFT]}
            if not kind:
                found |= {
                    "eigenvalues of M⁻¹K": naive.unscaled(model)[:SOFT],
                    "symmetric eigenvalues": naive.symmetric(model)[:SOFT],
                }
            return reference, found

        error |= sample(ratio, compute)
    return Row(
        title="Nearly rigid wires",
        driver="stiffness ratio k l / T",
        quantity="ω² of the two pendulum modes",
        value=np.asarray(ratio),
        error=error,
        finding=(
            "Eigenvalue solvers leave rounding errors of the largest ω² in the smallest. The"
            " program solves for 1 / ω², with the tensions of wires as unknowns."
        ),
        limit=(
            "none found on `string`, `beam` and `violin`; `force` with wires that lean: ε × ratio"
        ),
    )


def graded_chain(ratio: Any = STIFFNESS_RATIO) -> Row:
    """Compute errors of the pendulum modes of a chain, with several soft modes per block."""

    def compute(value: float) -> Any:
        model = registry.STRING.system(_chain(value))
        found = {
            SHIPPED: np.sort(eigenmodes.solve(model).omega_squared),
            "eigenvalues of M⁻¹K": naive.unscaled(model),
            "symmetric eigenvalues": naive.symmetric(model),
        }
        soft = SOFT * CHAIN
        return given_omega_squared(model)[:soft], {n: v[:soft] for n, v in found.items()}

    return Row(
        title="Nearly rigid wires, four stages",
        driver="stiffness ratio k l / T",
        quantity="ω² of the pendulum modes, given the matrices",
        value=np.asarray(ratio),
        error=sample(ratio, compute),
        finding=(
            "Rounding mixes several soft modes with stiff ones and with each other. In 1 / ω²"
            " the stiff ones vanish; theirs follow from the energies in their shapes, to 10⁻⁹ up"
            " to ratios of 10⁸."
        ),
        limit="none found",
    )


def _chain(ratio: float) -> Any:
    body = {"mass": MASS, "inertia": list(INERTIA)}
    every = []
    for n in range(1, CHAIN + 1):
        tension = (CHAIN + 1 - n) * TENSION
        wires = SHAPE | {"count": 4, "k": ratio * tension / SHAPE["l"], "d_upper": 0.001}
        every.append({"name": f"mass{n}", "body": body, "wires": wires})
    return design({"design": {"name": "chain"}, "stage": every})


def equal_modes(detuning: Any = DETUNING) -> Row:
    """Compute changes of the energy fractions that label modes, for changes of K by last bits."""
    error: dict[str, list[float]] = {}
    for value in detuning:
        scene = expand(design(document(s=0.05, t1=0.05, t2=0.05, d=0.0)))
        for name, angle, split in (
            (f"{SHIPPED}: symmetric design", 0.0, True),
            (f"{SHIPPED}: no symmetry left", 0.4, False),
        ):
            model = _detuned(string_model.linear_model(scene, split=split), float(value), angle)
            error.setdefault(name, []).append(_sensitivity_to_rounding(model, _shipped_fractions))
        model = _detuned(string_model.linear_model(scene, split=False), float(value), 0.4)
        error.setdefault("symmetric eigenvectors", []).append(
            _sensitivity_to_rounding(model, _eigh_fractions)
        )
    return Row(
        title="Nearly equal modes and their labels",
        driver="relative difference of two ω²",
        quantity="share of x by which a mode is labelled, K moved by last bits",
        value=np.asarray(detuning),
        error={name: np.array(values) for name, values in error.items()},
        finding=(
            "Eigenvectors of nearly equal modes turn by rounding over the gap. The program"
            " solves apart what a symmetry keeps apart; modes that agree to 10⁻⁹ get the basis of"
            " the fewest coordinates."
        ),
        limit="modes that differ by less than 10⁻⁹ are reported as degenerate",
    )


def _detuned(model: LinearSystem, difference: float, angle: float) -> LinearSystem:
    """Add a spring that raises omega^2 along the horizontal direction at `angle` (rad) from x."""
    x, y = model.index("test", "x"), model.index("test", "y")
    stiffness = model.stiffness.copy()
    direction = np.zeros(model.size)
    direction[x], direction[y] = np.cos(angle), np.sin(angle)
    stiffness += difference * stiffness[x, x] * np.outer(direction, direction)
    return _with_stiffness(model, stiffness)


def _with_stiffness(model: LinearSystem, stiffness: Any) -> LinearSystem:
    """Replace the stiffness, that of the wires included."""
    return replace(model, soft=stiffness, elongation=model.elongation[:0], k=model.k[:0])


def _shipped_fractions(model: LinearSystem) -> Any:
    found = eigenmodes.solve(model)
    return np.sort(found.energy[found.omega_squared.argsort(kind="stable")[:SOFT], 0, 0])


def _eigh_fractions(model: LinearSystem) -> Any:
    from scipy import linalg

    _, shapes = linalg.eigh(model.stiffness[6:, 6:], model.mass[6:, 6:])
    return np.sort((shapes[0] ** 2 * model.mass[6, 6])[:SOFT])


def _sensitivity_to_rounding(model: LinearSystem, fractions: Any) -> float:
    """Largest change of energy fractions over random changes of the last bits of K."""
    rng, found = np.random.default_rng(3), []
    for _ in range(8):
        noise = np.triu(rng.choice([-1.0, 0.0, 1.0], model.stiffness.shape)) * np.finfo(float).eps
        factor = 1 + noise + np.triu(noise, 1).T
        found.append(fractions(_with_stiffness(model, model.stiffness * factor)))
    return float(np.ptp(np.array(found), axis=0).max())


def quality(loss: Any = LOSS) -> Row:
    """Compute errors of Q of the longitudinal mode, in which tilt stretches the wires a little."""
    error: dict[str, list[float]] = {}
    value = []
    for phi in loss:
        raw = document(d=0.005)
        raw["materials"] = {"glass": {"youngs_modulus": 7e10, "loss_angle": float(phi)}}
        raw["stage"][0]["wires"]["material"] = "glass"
        model = registry.STRING.system(design(raw))
        block = next(
            group for group in Structure(model).blocks if model.index("test", "x") in group
        )
        reference = _exact_q(model, block)
        found = damped.solve(model)
        where = [home[1] for home in found.home].index("x")
        answers = {
            SHIPPED: found.q[where],
            "poles of a state space": _pole_q(model),
            "width of the resonance": _width(model, block),
        }
        for name, q in answers.items():
            error.setdefault(name, []).append(float(relative(q, reference)))
        value.append(reference)
    return Row(
        title="Q above 10⁹",
        driver="Q of the longitudinal mode",
        quantity="Q",
        value=np.array(value),
        error={name: np.array(values) for name, values in error.items()},
        finding=(
            "A pole has 1/Q in its real part, which drowns in the rounding of its imaginary one;"
            " the width of a resonance drowns sooner. The program takes decay from what the"
            " motion dissipates."
        ),
        limit="none found; sweeps and sensitivities take Q to first order, which is off by φ²",
    )


def _pole_q(model: LinearSystem) -> float:
    """Q of the slowest pole of a state space with equivalent viscous damping, |p| / (-2 Re p)."""
    known = signals.bodies_with_signals(model)
    system = statespace.build(
        model, [signals.parse_input("support.x", known)], [signals.parse_output("test.x", known)]
    )
    poles = np.linalg.eigvals(system.a)
    slowest = poles[np.abs(poles).argmin()]
    with np.errstate(divide="ignore"):
        return float(np.abs(slowest) / (-2 * slowest.real))


def _exact_q(model: LinearSystem, block: Any) -> float:
    """Q = Im s / (-2 Re s) of the lowest pole s = i omega of a block of two, in 60 digits.

    From the quadratic equation in omega^2.
    """
    m = mpmath.mp.clone()
    m.dps = 60
    mass = [m.mpf(float(v)) for v in np.diag(model.mass)[block]]
    k = [[m.mpc(complex(v)) for v in line] for line in model.complete[np.ix_(block, block)]]
    a, d, b2 = k[0][0] / mass[0], k[1][1] / mass[1], k[0][1] * k[1][0] / (mass[0] * mass[1])
    root = m.sqrt((a - d) ** 2 + 4 * b2)
    lowest = min(((a + d + root) / 2, (a + d - root) / 2), key=lambda v: m.re(v))
    omega = m.sqrt(lowest)
    return float(m.re(omega) / (2 * m.im(omega)))


def _width(model: LinearSystem, block: Any) -> float:
    """Q from the half-power width of |H|^2 about the resonance of the lossless eigenvalues."""
    mass, stiffness = model.mass[np.ix_(block, block)], model.complete[np.ix_(block, block)]
    centre = np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, stiffness.real)).real.min())
    low, high = 1e-18, 1e-1
    for _ in range(200):
        middle = np.sqrt(low * high)
        peak, side = (
            np.abs(np.linalg.inv(stiffness - (centre * (1 + off)) ** 2 * mass)[0, 0])
            for off in (0.0, middle)
        )
        low, high = (middle, high) if side > peak / np.sqrt(2) else (low, middle)
    return 1 / (2 * low)
