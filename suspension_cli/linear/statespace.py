"""State space x' = A x + B u, y = C x + D u of a linear system, all variables named.

With body coordinates q (massless ones eliminated) the equations of motion are

    M q'' + Cv q' + K q + Ms s'' + Cs s' + Ks s = f

for motions s of the support. In z = q + M^-1 Ms s the accelerations of the support drop out, and in
w = z' + M^-1 (Cv z + (Cs - Cv M^-1 Ms) s) its velocities do, so that displacements of the support
are a proper input:

    z' = w - M^-1 (Cv z + Cs~ s),    w' = M^-1 (f - K z - Ks~ s),
    Cs~ = Cs - Cv M^-1 Ms,    Ks~ = Ks - K M^-1 Ms.

Without damping w is the velocity. Loss angles have no finite state space: the modes of each block
get viscous damping of the same Q. `agreement_band` finds where the result agrees with the direct
solution.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from suspension_cli.conventions import FRAME
from suspension_cli.errors import InputError
from suspension_cli.linear import response, signals
from suspension_cli.linear.pencil import Block, Pencil
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.system import LinearSystem
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Inexact, Int

FAINT = 1e-6
"""Fraction of an output's largest response below which errors are relative to it."""

SOLVED = 1 << 21
"""Most numbers in the matrices that are solved at once."""
GRID = 801
"""Number of frequencies at which a system is compared with the direct solution."""


@dataclass(frozen=True)
class StateSpace:
    """Linear system in state space, SI, with names and units."""

    a: Float[np.ndarray, "state state"]
    b: Float[np.ndarray, "state input"]
    c: Float[np.ndarray, "output state"]
    d: Float[np.ndarray, "output input"]
    state: tuple[str, ...]
    state_unit: tuple[str, ...]
    input: tuple[str, ...]
    input_unit: tuple[str, ...]
    output: tuple[str, ...]
    output_unit: tuple[str, ...]

    def at(
        self, frequency: Float[np.ndarray, " frequency"]
    ) -> Complex[np.ndarray, "frequency output input"]:
        """Compute the transfer matrix by a dense solve at each frequency in Hz.

        States are first scaled by powers of 2 that balance A, as in MATLAB. Unscaled rates are
        omega times displacements, which misleads pivoting and costs up to 9 digits far above the
        modes.
        """
        from scipy.linalg import matrix_balance

        s = 2j * np.pi * np.asarray(frequency)
        scale = (
            matrix_balance(self.a, permute=False, separate=True)[1][0]
            if len(self.a)
            else np.ones(0)
        )
        a, b, c = self.a * scale / scale[:, None], self.b / scale[:, None], self.c * scale
        result = np.empty((len(s), *self.d.shape), dtype=complex)
        step = max(1, SOLVED // max(len(scale), 1) ** 2)
        for start in range(0, len(s), step):
            some = slice(start, start + step)
            dynamic = s[some, None, None] * np.eye(len(scale)) - a
            drive = np.broadcast_to(b.astype(complex), (len(dynamic), *b.shape))
            result[some] = c @ np.linalg.solve(dynamic, drive) + self.d
        return result


def build(model: LinearSystem, inputs: list[Signal], outputs: list[Signal]) -> StateSpace:
    """Build the state space from support motions and forces to motions.

    It covers the blocks that an input drives and an output senses, of a system without batch axes.
    """
    rows = np.array([signals.linear_form(signal, model) for signal in outputs])
    drives = np.array([signals.linear_form(signal, model) for signal in inputs])
    return assemble(model, drives, inputs, rows, outputs)


def refuse_ground(inputs: list[Signal]) -> None:
    """Raise `InputError` for motions of the ground, which are no inputs of a state space."""
    for signal in inputs:
        if signal.is_ground:
            remedy = (
                "take motions of the support and forces; pendsus response has responses to the"
                " ground"
            )
            problem = "a motion of the ground beside the support is no input of a state space"
            raise InputError.of("--input", problem, remedy, signal.text)


def assemble(
    model: LinearSystem,
    drives: Float[np.ndarray, "input coordinate"],
    inputs: list[Signal],
    rows: Float[np.ndarray, "output coordinate"],
    outputs: list[Signal],
    *,
    undriven: bool = False,
) -> StateSpace:
    """Build the state space from driving linear forms to sensed linear forms.

    It covers the blocks that are driven and sensed; with `undriven`, all that are sensed.
    """
    refuse_ground(inputs)
    acts = np.array([signal.acts for signal in inputs], dtype=bool)
    drives = drives.reshape(len(inputs), model.size)
    moves = np.where(acts[:, None], 0.0, drives[:, :6]).T
    forces = np.where(acts[:, None], drives, 0.0).T
    a: list[Array] = []
    b: list[Array] = []
    c: list[Array] = []
    feed = rows[:, :6] @ moves
    states: list[str] = []
    for block in Pencil.of(model.constant).blocks:
        if not rows[:, block.keep].any() or not (undriven or block.is_driven(moves, forces).any()):
            continue
        part = _block(condense(block), moves, forces, rows)
        a.append(part.a)
        b.append(part.b)
        c.append(part.c)
        feed = feed + part.d
        states += [
            f"{model.coordinate[n]}{kind}" for kind, coordinates in part.states for n in coordinates
        ]
    size = sum(len(part) for part in a)
    whole, place = np.zeros((size, size)), 0
    for part in a:
        whole[place : place + len(part), place : place + len(part)] = part
        place += len(part)
    return StateSpace(
        a=whole,
        b=np.concatenate([np.zeros((0, len(inputs))), *b]),
        c=np.concatenate([np.zeros((len(outputs), 0)), *c], axis=1),
        d=feed,
        state=tuple(states),
        state_unit=tuple(_unit(name) for name in states),
        input=tuple(signal.text for signal in inputs),
        input_unit=tuple(signal.unit for signal in inputs),
        output=tuple(signal.text for signal in outputs),
        output_unit=tuple(signal.unit for signal in outputs),
    )


def _unit(state: str) -> str:
    name, _, kind = state.partition(" ")
    if name.startswith("relaxation"):
        return "s sqrt(J)"
    if name.startswith("wire-"):
        return "m sqrt(kg)" + ("/s" if kind else "")
    linear = name.rsplit(".", 1)[1] in "xyz"
    if kind == "momentum":
        return "N s" if linear else "N m s"
    return ("m" if linear else "rad") + ("/s" if kind else "")


@dataclass(frozen=True)
class _Part:
    """State space of one block, and the coordinates of its states by kind (suffix of the name)."""

    a: Float[np.ndarray, "state state"]
    b: Float[np.ndarray, "state input"]
    c: Float[np.ndarray, "output state"]
    d: Float[np.ndarray, "output input"]
    states: tuple[tuple[str, Int[np.ndarray, " _"]], ...]


@dataclass(frozen=True)
class Condensed:
    """One block without its tensions and its blade tips without mass and damping.

    Attributes
    ----------
    kept
        Its other coordinates.
    mass, damping, stiffness
        Towards the support and the coordinates kept; K is complex if lossy.
    """

    kept: Int[np.ndarray, " kept"]
    mass: Float[np.ndarray, "kept 6+kept"]
    damping: Float[np.ndarray, "kept 6+kept"]
    stiffness: Inexact[np.ndarray, "kept 6+kept"]


def condense(block: Block) -> Condensed:
    """Eliminate the tensions of a block and its blade tips without mass and damping.

    Neither inputs nor outputs act on these.
    """
    model, keep, size = block.pencil.model, block.keep, len(block.owner)
    whole = block.at(block.pencil.at(np.zeros(1))).matrix[..., 0]
    if not np.imag(whole).any():
        whole = np.real(whole)
    frame = np.array([model.coordinate[n].startswith(FRAME) for n in keep], dtype=bool)
    light = model.massless[keep] & ~frame & ~(model.damping[keep] != 0).any(1)
    a = np.flatnonzero(~light)
    b = np.append(np.flatnonzero(light), np.arange(len(keep), size))
    columns = np.append(np.arange(6), 6 + a)
    follow = -np.linalg.solve(whole[b[:, None], 6 + b], whole[b[:, None], columns])
    stiffness = _sum(whole[a[:, None], columns], whole[a[:, None], 6 + b], follow)
    stiffness[:, 6:] = (stiffness[:, 6:] + stiffness[:, 6:].T) / 2
    at = np.ix_(keep[a], np.append(np.arange(6), keep[a]))
    return Condensed(keep[a], model.mass[at], model.damping[at], stiffness)


def _block(
    block: Condensed,
    moves: Float[np.ndarray, "6 input"],
    forces: Float[np.ndarray, "coordinate input"],
    rows: Float[np.ndarray, "output coordinate"],
) -> _Part:
    """Build the state space of one block: inputs `moves` and `forces`, outputs `rows`.

    Where a damper resists coordinates b without mass (of a massless support structure), its momenta
    p are states too:

        p = U^T (C_ba a + C_bb b + C_bs s),    p' = U^T (f - K_ba a - K_bb b - K_bs s),

    with U the directions that dampers resist. In the others the forces of springs balance; both
    conditions together determine b.
    """
    from scipy.linalg import qr

    heavy = np.flatnonzero((block.mass[:, 6:] != 0).any(1))
    light = np.setdiff1d(np.arange(len(block.kept)), heavy)
    mass = block.mass[np.ix_(heavy, 6 + heavy)]
    stiffness, damping = np.real(block.stiffness), block.damping.copy()
    if np.iscomplexobj(block.stiffness):
        damping[np.ix_(heavy, 6 + heavy)] += _equivalent(block, mass, light)
    force = forces[block.kept]
    k, c = stiffness[:, 6:], damping[:, 6:]
    parts = [np.ix_(r, s) for r in (heavy, light) for s in (heavy, light)]
    (k_hh, k_hl, k_lh, k_ll), (c_hh, c_hl, c_lh, c_ll) = (
        [m[part] for part in parts] for m in (k, c)
    )
    k_s, c_s = stiffness[:, :6] @ moves, damping[:, :6] @ moves
    shift = -np.linalg.solve(mass, block.mass[heavy, :6] @ moves)  # a = z + shift u
    directions, _, _ = np.linalg.svd(c_ll)
    rank = np.linalg.matrix_rank(c_ll, tol=1e-12 * np.abs(c).max(initial=0.0)) if len(light) else 0
    resisted, unresisted = directions[:, :rank].T, directions[:, rank:].T
    if np.abs(unresisted @ damping[light]).max(initial=0.0) > 1e-12 * np.abs(damping).max(
        initial=0.0
    ):
        remedy = "give [support] a mass and inertia"
        raise InputError.of(
            "control.loop",
            "a damper pushes a support structure without mass along a motion that it does"
            " not sense, which leaves that motion undetermined",
            remedy,
        )
    solve = np.linalg.inv(np.concatenate([resisted @ c_ll, unresisted @ k_ll]))
    coupling = np.concatenate([resisted @ c_lh, unresisted @ k_lh])
    follow_z = _sum(np.zeros_like(coupling), -solve, coupling)
    # coordinates q = of_z z + of_p p + of_u u
    of_z, of_p, of_u = (
        np.zeros((len(k), len(heavy))),
        np.zeros((len(k), rank)),
        np.zeros((len(k), moves.shape[1])),
    )
    of_z[heavy], of_z[light] = np.eye(len(heavy)), follow_z
    of_p[light] = solve[:, :rank]
    of_u[heavy], of_u[light] = (
        shift,
        follow_z @ shift
        + solve
        @ np.concatenate([-resisted @ c_s[light], unresisted @ (force[light] - k_s[light])]),
    )
    z, w, p = (
        slice(n, m)
        for n, m in (
            (0, len(heavy)),
            (len(heavy), 2 * len(heavy)),
            (2 * len(heavy), 2 * len(heavy) + rank),
        )
    )
    a, b = np.zeros((p.stop, p.stop)), np.zeros((p.stop, moves.shape[1]))
    a[z, w] = np.eye(len(heavy))
    a[z, z] = -np.linalg.solve(mass, _sum(c_hh, c_hl, follow_z))
    a[w, z] = -np.linalg.solve(mass, _sum(k_hh, k_hl, follow_z))
    a[p, z] = -resisted @ _sum(k_lh, k_ll, follow_z)
    a[z, p], a[w, p], a[p, p] = (
        -np.linalg.solve(mass, c[heavy] @ of_p),
        -np.linalg.solve(mass, k[heavy] @ of_p),
        -resisted @ k[light] @ of_p,
    )
    b[z] = -np.linalg.solve(mass, _sum(c_s[heavy], c[heavy], of_u))
    b[w] = np.linalg.solve(mass, force[heavy] - _sum(k_s[heavy], k[heavy], of_u))
    b[p] = resisted @ (force[light] - _sum(k_s[light], k[light], of_u))
    sensed = rows[:, block.kept]
    sensed_z, sensed_p = sensed @ of_z, sensed @ of_p
    leading = light[qr(resisted, mode="r", pivoting=True)[-1][:rank]] if rank else light[:0]
    return _Part(
        a,
        b,
        np.concatenate([sensed_z, np.zeros_like(sensed_z), sensed_p], axis=1),
        sensed @ of_u,
        (("", block.kept[heavy]), (" rate", block.kept[heavy]), (" momentum", block.kept[leading])),
    )


def _sum(
    direct: Float[np.ndarray, "row column"],
    matrix: Float[np.ndarray, "row inner"],
    shift: Float[np.ndarray, "inner column"],
) -> Float[np.ndarray, "row column"]:
    """Compute direct + matrix @ shift, exactly 0 where its terms cancel to rounding.

    A residue of 1e-16 would be a spurious coupling with transmission zeros of its own.
    """
    total, size = direct + matrix @ shift, np.abs(direct) + np.abs(matrix) @ np.abs(shift)
    return np.where(np.abs(total) > 64 * np.finfo(float).eps * size, total, 0.0)


def _equivalent(
    block: Condensed,
    mass: Float[np.ndarray, "kept kept"],
    light: Int[np.ndarray, " light"],
) -> Float[np.ndarray, "kept kept"]:
    """Viscous damping of a block's coordinates with mass, equivalent to all its loss angles."""
    whole = block.stiffness[:, 6:]
    heavy = np.setdiff1d(np.arange(len(whole)), light)
    across = whole[np.ix_(light, heavy)]
    reduced = whole[np.ix_(heavy, heavy)]
    reduced = reduced - across.T @ np.linalg.solve(whole[np.ix_(light, light)], across)
    return equivalent_damping(mass, np.real(reduced), np.imag(reduced))


def equivalent_damping(
    mass: Float[np.ndarray, "coordinate coordinate"],
    stiffness: Float[np.ndarray, "coordinate coordinate"],
    loss: Float[np.ndarray, "coordinate coordinate"],
) -> Float[np.ndarray, "coordinate coordinate"]:
    """Viscous damping that gives each mode of a block the Q of its loss angles.

    With M, Re K (`stiffness`) and K'' = Im K (`loss`), a mode v of unit modal mass has the loss
    angle eta = v^T K'' v / omega^2, and C = M (sum over modes of v eta omega v^T) M damps it as
    much.
    """
    root = np.linalg.inv(np.linalg.cholesky(mass))
    values, vectors = np.linalg.eigh(root @ stiffness @ root.T)
    shapes = root.T @ vectors
    dissipated = np.einsum("im,ij,jm->m", shapes, loss, shapes)
    rate = np.where(values > 0, dissipated / np.sqrt(np.where(values > 0, values, 1.0)), 0.0)
    return mass @ (shapes * rate) @ shapes.T @ mass


class TransferMatrix(Protocol):
    """A system with responses: a state space, or poles and zeros."""

    def at(self, frequency: Array) -> Complex[np.ndarray, "frequency output input"]:
        """Evaluate the responses (f, o, i) at frequencies (f,) in Hz."""
        ...


def agreement_band(
    system: TransferMatrix,
    model: LinearSystem,
    inputs: list[Signal],
    outputs: list[Signal],
    tolerance: float = 1e-9,
) -> tuple[tuple[float, float] | None, float, tuple[float, float]]:
    """Find the frequency band in which a system agrees with the direct solution.

    Parameters
    ----------
    system : object with ``at(frequency)``
    tolerance
        Largest error, as in `relative_errors`.

    Returns
    -------
    band : tuple of float or None
        Widest band of agreement, Hz; None if no two neighbouring frequencies agree.
    worst : float
        Largest error at the frequencies tried; infinite where a response is NaN.
    tried : tuple of float
        Lowest and highest frequency tried, Hz: 1/100 of the lowest and 100 times the highest mode.
    """
    lowest, highest = mode_range(model)
    frequency = np.geomspace(lowest / 100, highest * 100, GRID)
    error = relative_errors(system, model, frequency, inputs, outputs).max((1, 2))
    tried = (float(frequency[0]), float(frequency[-1]))
    return widest_band(frequency, error <= tolerance), float(error.max()), tried


def relative_errors(
    system: TransferMatrix,
    model: LinearSystem,
    frequency: Float[np.ndarray, " frequency"],
    inputs: list[Signal],
    outputs: list[Signal],
) -> Float[np.ndarray, "frequency output input"]:
    """Compute the errors of a system against the direct solution of a model.

    They are relative to each response, or to `FAINT` of the output's largest response to an input
    of the same unit (the direct solution loses digits of fainter ones too).
    """
    exact = response.solve(model, frequency, inputs, outputs).value
    values = system.at(frequency)
    size = np.abs(exact)
    for unit in {signal.unit for signal in inputs}:
        same_unit = [signal.unit == unit for signal in inputs]
        size[:, :, same_unit] = np.where(
            exact[:, :, same_unit] == 0,
            0.0,
            np.maximum(size[:, :, same_unit], FAINT * size[:, :, same_unit].max(-1, keepdims=True)),
        )
    error = np.where(
        size > 0,
        np.abs(values - exact) / np.where(size > 0, size, 1.0),
        np.where(values == 0, 0.0, np.inf),
    )
    return np.where(np.isnan(error), np.inf, error)


def widest_band(
    frequency: Float[np.ndarray, " frequency"], agrees: Bool[np.ndarray, " frequency"]
) -> tuple[float, float] | None:
    """Find the widest band in which a system agrees; None if no two neighbouring frequencies do."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], agrees, [False]]).astype(int)))
    starts, stops = edges[::2], edges[1::2]
    if (stops - starts).max(initial=0) < 2:
        return None
    widest = int((stops - starts).argmax())
    return float(frequency[starts[widest]]), float(frequency[stops[widest] - 1])


def mode_range(model: LinearSystem) -> tuple[float, float]:
    """Lowest and highest frequency of modes that are neither rigid nor unstable, Hz."""
    from suspension_cli.linear import eigenmodes

    found = eigenmodes.solve(model).omega_squared
    positive = np.sqrt(found[found > 0]) / (2 * np.pi)
    return (float(positive[0]), float(positive[-1])) if len(positive) else (1.0, 1.0)
