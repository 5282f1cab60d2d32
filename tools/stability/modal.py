"""Modes that are far apart, close together, or hardly damped."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mpmath
import numpy as np

from stability import naive
from stability.references import INERTIA, MASS, SHAPE, design, document, given_omega_squared, omega_squared, stage
from stability.row import SHIPPED, Row, relative
from suspension_cli.analysis import damped, modes, signals, statespace
from suspension_cli.mechanics import assemble
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.mechanics.nominal import expand
from suspension_cli.models import fidelity

STIFFNESS_RATIO = 10.0 ** np.arange(1, 16)
DETUNING = 10.0 ** np.arange(0, -16, -1)
LOSS = 10.0 ** np.arange(-2, -15, -1)
SOFT = 2
"""Longitudinal and transverse: the modes that live of the tension alone."""
TENSION = MASS * 9.81 / 4
CHAIN = 4


def rigid_wires(ratio: Any = STIFFNESS_RATIO) -> Row:
    """Soft modes of one stage whose wires are `ratio` times stiffer along than across."""
    error: dict[str, list[float]] = {}
    for value in ratio:
        k = float(value * TENSION / SHAPE["l"])
        for kind, more in (("", {}), (", wires at 3°", {"t1": 0.0815})):
            model = fidelity.linear_model(design(document(k=k, **more)), "string")
            reference = np.array([float(v) for v in omega_squared(stage(shape={"k": k, **more}))[:SOFT]])
            found = {f"{SHIPPED}{kind}": np.sort(modes.solve(model).omega_squared)[:SOFT]}
            if not kind:
                found |= {"eigenvalues of M⁻¹K": naive.unscaled(model)[:SOFT], "symmetric eigenvalues": naive.symmetric(model)[:SOFT]}
            for name, omega2 in found.items():
                error.setdefault(name, []).append(float(relative(omega2, reference).max()))
    return Row(
        title="Nearly rigid wires",
        driver="stiffness ratio k l / T",
        quantity="ω² of the two pendulum modes",
        value=np.asarray(ratio),
        error={name: np.array(values) for name, values in error.items()},
        finding=(
            "Eigenvalue solvers leave rounding errors of the largest ω² in the smallest. The program projects on the soft modes and solves "
            "them again by themselves; "
            "where wires lean, the sums in the stiffness matrix round the soft part away before any solver sees it, so what they round is "
            "kept and projected too."
        ),
        limit="none found on `string`, `beam` and `violin`; `force` with wires that lean: ε × ratio, and `modes` warns where that passes 10⁻⁴",
    )


def graded_chain(ratio: Any = STIFFNESS_RATIO) -> Row:
    """All modes of a chain of stages, several soft ones in each block."""
    error: dict[str, list[float]] = {}
    for value in ratio:
        model = fidelity.linear_model(_chain(float(value)), "string")
        reference = given_omega_squared(model)
        found = {
            SHIPPED: np.sort(modes.solve(model).omega_squared),
            "eigenvalues of M⁻¹K": naive.unscaled(model),
            "symmetric eigenvalues": naive.symmetric(model),
        }
        for name, omega2 in found.items():
            error.setdefault(name, []).append(float(relative(omega2, reference).max()))
    return Row(
        title="Nearly rigid wires, four stages",
        driver="stiffness ratio k l / T",
        quantity="ω² of all modes, given the matrices",
        value=np.asarray(ratio),
        error={name: np.array(values) for name, values in error.items()},
        finding=(
            "In a chain several soft modes share a block with stiff ones, and rounding mixes them with each other too. "
            "The program takes the stiff modes out first, so that each group is solved at its own scale."
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
    """How much the shares by which modes are labelled move when every number of K moves by its last bit."""
    error: dict[str, list[float]] = {}
    for value in detuning:
        scene = expand(design(document(s=0.05, t1=0.05, t2=0.05, d=0.0)))
        for name, angle, split in ((f"{SHIPPED}: symmetric design", 0.0, True), (f"{SHIPPED}: no symmetry left", 0.4, False)):
            model = _detuned(assemble.linear_model(scene, split=split), float(value), angle)
            error.setdefault(name, []).append(_moved(model, _shipped_shares))
        model = _detuned(assemble.linear_model(scene, split=False), float(value), 0.4)
        error.setdefault("symmetric eigenvectors", []).append(_moved(model, _eigh_shares))
    return Row(
        title="Nearly equal modes and their labels",
        driver="relative difference of two ω²",
        quantity="share of x by which a mode is labelled, K moved by last bits",
        value=np.asarray(detuning),
        error={name: np.array(values) for name, values in error.items()},
        finding=(
            "Eigenvectors of nearly equal modes turn by rounding over the gap, so that labels depend on the last bit. "
            "The program solves what a symmetry keeps apart by itself, and gives modes that agree to 10⁻⁹ the basis that lives in as few "
            "coordinates as possible."
        ),
        limit="modes that differ by less than 10⁻⁹ are told as degenerate",
    )


def _detuned(model: LinearModel, difference: float, angle: float) -> LinearModel:
    """The model with a spring that raises omega^2 along a horizontal direction at `angle` (rad) from x."""
    x, y = model.index("test", "x"), model.index("test", "y")
    stiffness = model.stiffness.copy()
    direction = np.zeros(model.size)
    direction[x], direction[y] = np.cos(angle), np.sin(angle)
    stiffness += difference * stiffness[x, x] * np.outer(direction, direction)
    return replace(model, stiffness=stiffness)


def _shipped_shares(model: LinearModel) -> Any:
    found = modes.solve(model)
    return np.sort(found.energy[found.omega_squared.argsort(kind="stable")[:SOFT], 0, 0])


def _eigh_shares(model: LinearModel) -> Any:
    from scipy import linalg

    _, shapes = linalg.eigh(model.stiffness[6:, 6:], model.mass[6:, 6:])
    return np.sort((shapes[0] ** 2 * model.mass[6, 6])[:SOFT])


def _moved(model: LinearModel, shares: Any) -> float:
    """Largest change of shares over some random changes of the last bits of K."""
    rng, found = np.random.default_rng(3), []
    for _ in range(8):
        noise = np.triu(rng.choice([-1.0, 0.0, 1.0], model.stiffness.shape)) * np.finfo(float).eps
        factor = 1 + noise + np.triu(noise, 1).T
        found.append(shares(replace(model, stiffness=model.stiffness * factor)))
    return float(np.ptp(np.array(found), axis=0).max())


def quality(loss: Any = LOSS) -> Row:
    """Q of the longitudinal mode, whose wires stretch a little as it tilts."""
    error: dict[str, list[float]] = {}
    value = []
    for phi in loss:
        raw = document(d=0.005)
        raw["materials"] = {"glass": {"youngs_modulus": 7e10, "loss_angle": float(phi)}}
        raw["stage"][0]["wires"]["material"] = "glass"
        model = fidelity.linear_model(design(raw), "string")
        block = next(group for group in model.blocks if model.index("test", "x") in group)
        reference = _exact_q(model, block)
        found = damped.solve(model, modes.solve(model))
        where = [home[1] for home in found.home].index("x")
        answers = {SHIPPED: found.q[where], "poles of a state space": _pole_q(model), "width of the resonance": _width(model, block)}
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
            "A pole holds 1/Q in its real part, below the rounding of its imaginary one as Q nears 10¹⁵, and the width of a resonance drowns sooner. "
            "The program takes the poles in the basis of the modes without loss, and their decay from what their motion dissipates: all digits at any Q."
        ),
        limit="none found; sweeps and sensitivities take Q to first order, which is off by φ²",
    )


def _pole_q(model: LinearModel) -> float:
    """|p| / (-2 Re p) of the slowest pole of x' = A x, with the viscous damping that gives each mode its loss."""
    known = signals.bodies(model)
    system = statespace.build(model, [signals.drive("support.x", known)], [signals.motion("test.x", known)])
    poles = np.linalg.eigvals(system.a)
    slowest = poles[np.abs(poles).argmin()]
    with np.errstate(divide="ignore"):
        return float(np.abs(slowest) / (-2 * slowest.real))


def _exact_q(model: LinearModel, block: Any) -> float:
    """Im s / (-2 Re s) of the lowest pole s = i omega of a block of two, from the quadratic equation in omega^2 in 60 digits."""
    m = mpmath.mp.clone()
    m.dps = 60
    mass = [m.mpf(float(v)) for v in np.diag(model.mass)[block]]
    k = [[m.mpc(complex(v)) for v in line] for line in model.lossy[np.ix_(block, block)]]
    a, d, b2 = k[0][0] / mass[0], k[1][1] / mass[1], k[0][1] * k[1][0] / (mass[0] * mass[1])
    root = m.sqrt((a - d) ** 2 + 4 * b2)
    lowest = min(((a + d + root) / 2, (a + d - root) / 2), key=lambda v: m.re(v))
    omega = m.sqrt(lowest)
    return float(m.re(omega) / (2 * m.im(omega)))


def _width(model: LinearModel, block: Any) -> float:
    """Q from where |H|^2 falls to half, read off a fine grid around the resonance that the lossless eigenvalues give."""
    mass, stiffness = model.mass[np.ix_(block, block)], model.lossy[np.ix_(block, block)]
    centre = np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, stiffness.real)).real.min())
    low, high = 1e-18, 1e-1
    for _ in range(200):
        middle = np.sqrt(low * high)
        peak, side = (np.abs(np.linalg.inv(stiffness - (centre * (1 + off)) ** 2 * mass)[0, 0]) for off in (0.0, middle))
        low, high = (middle, high) if side > peak / np.sqrt(2) else (low, middle)
    return 1 / (2 * low)
