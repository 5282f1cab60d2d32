"""State space x' = A x + B u, y = C x + D u of a linear system, all variables named.

>>> from suspension_cli.design import reader
>>> from suspension_cli.models import registry
>>> model = registry.STRING.system(reader.parse(reader.template("single", "single")))
>>> ends = [signals.parse(text, "", ("support", "test")) for text in ("support.x", "test.x")]
>>> build(model, ends[:1], ends[1:]).state
('test.x', 'test.pitch', 'test.x rate', 'test.pitch rate')

With body coordinates q (massless ones eliminated) the equations of motion are

    M q'' + Cv q' + K q + Ms s'' + Cs s' + Ks s = f

for motions s of the support. In z = q + M^-1 Ms s the accelerations of the support drop out, and in
w = z' + M^-1 (Cv z + (Cs - Cv M^-1 Ms) s) its velocities do, so that displacements of the support
are a proper input:

    z' = w - M^-1 (Cv z + Cs~ s),    w' = M^-1 (f - K z - Ks~ s),
    Cs~ = Cs - Cv M^-1 Ms,    Ks~ = Ks - K M^-1 Ms.

Without damping w is the velocity. Loss angles have no finite state space: the modes of each block
get viscous damping of the same Q.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from suspension_cli.elimination import connected_groups
from suspension_cli.errors import InputError
from suspension_cli.files.declared import NOT_STORED, along, in_unit
from suspension_cli.files.documents import Layout
from suspension_cli.linear import signals
from suspension_cli.linear.pencil import Block
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.solver import Solver
from suspension_cli.linear.system import LinearSystem
from suspension_cli.linear.terms import TermWithStates

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact, Int

SOLVED = 1 << 21
"""Most numbers in the matrices that are solved at once."""
ROUNDING = 1e-10
"""Real part of a pole, relative to its modulus, that may be a rounding error."""
RATE = " rate"
MOMENTUM = " momentum"
"""Kinds of states besides the coordinates: the ends of their names."""
OF_FILTERS = ("loop ", "sensor ")
"""States of filters: how their names start."""
NAMED = 0.2
"""Fraction of a pole's participation in mechanical states above which it is named after one."""


@dataclass(frozen=True)
class StateSpace:
    """Linear system in state space, SI, with names and units."""

    in_json: ClassVar = Layout(only="state input output")
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

    def balanced(self) -> StateSpace:
        """Scale states by powers of 2 that balance A, as in MATLAB.

        Unscaled rates are omega times displacements, which misleads pivoting and costs up to 9
        digits far above the modes.
        """
        from scipy.linalg import matrix_balance

        if not len(self.a):
            return self
        scale = matrix_balance(self.a, permute=False, separate=True)[1][0]
        a = self.a * scale / scale[:, None]
        b = self.b / scale[:, None]
        c = self.c * scale
        return replace(self, a=a, b=b, c=c)

    def at(
        self, frequency: Float[np.ndarray, " frequency"]
    ) -> Complex[np.ndarray, "frequency output input"]:
        """Compute the transfer matrix at frequencies in Hz, by dense solves of what is coupled."""
        s = 2j * np.pi * np.asarray(frequency)
        own = self.balanced()
        result = np.tile(self.d.astype(complex), (len(s), 1, 1))
        for group in connected_groups(own.a != 0):
            a = own.a[np.ix_(group, group)]
            b = own.b[group].astype(complex)
            c = own.c[:, group]
            step = max(1, SOLVED // len(a) ** 2)
            for start in range(0, len(s), step):
                some = slice(start, start + step)
                dynamic = s[some, None, None] * np.eye(len(a)) - a
                drive = np.broadcast_to(b, (len(dynamic), *b.shape))
                result[some] += c @ np.linalg.solve(dynamic, drive)
        return result


def is_of_filter(state: str) -> bool:
    """Whether a state is that of a filter of a loop or a sensor."""
    return state.startswith(OF_FILTERS)


def build(model: LinearSystem, inputs: list[Signal], outputs: list[Signal]) -> StateSpace:
    """Build the state space from support motions and forces to motions, without batch axes."""
    rows = np.array([signals.linear_form(signal, model) for signal in outputs])
    drives = np.array([signals.linear_form(signal, model) for signal in inputs])
    return assemble(model, drives, inputs, rows, outputs)


def refuse_ground(inputs: list[Signal]) -> None:
    """Raise `InputError` for motions of the ground, which are no inputs of a state space."""
    for signal in inputs:
        if signal.is_ground:
            problem = "a motion of the ground beside the support is no input of a state space"
            remedy = (
                "take motions of the support and forces; pendsus response has responses to the"
                " ground"
            )
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
    from scipy.linalg import block_diag

    refuse_ground(inputs)
    acts = np.array([signal.acts for signal in inputs], dtype=bool)
    drives = drives.reshape(len(inputs), model.size)
    moves = np.where(acts[:, None], 0.0, drives[:, :6]).T
    forces = np.where(acts[:, None], drives, 0.0).T
    feed = rows[:, :6] @ moves
    damped = model.damping + _equivalent_damping(model.constant)
    model = with_states(replace(model, damping=damped)).constant
    more = model.size - rows.shape[1]
    rows = np.pad(rows, ((0, 0), (0, more)))
    forces = np.pad(forces, ((0, more), (0, 0)))
    parts = []
    states = list[str]()
    units = list[str]()
    for block in Solver(model).blocks:
        if rows[:, block.keep].any() and (undriven or block.is_driven(moves, forces).any()):
            part = _block(block, model.damping, moves, forces, rows)
            parts.append(part)
            feed = feed + part.d
            for kind, coordinates in part.states:
                states += [f"{model.coordinate[n]}{kind}" for n in coordinates]
                units += [_unit(kind, model, n) for n in coordinates]
    return StateSpace(
        a=np.asarray(block_diag(np.zeros((0, 0)), *(part.a for part in parts))),
        b=np.concatenate([np.zeros((0, len(inputs))), *(part.b for part in parts)]),
        c=np.concatenate([np.zeros((len(outputs), 0)), *(part.c for part in parts)], axis=1),
        d=feed,
        state=tuple(states),
        state_unit=tuple(units),
        input=tuple(signal.text for signal in inputs),
        input_unit=tuple(signal.unit for signal in inputs),
        output=tuple(signal.text for signal in outputs),
        output_unit=tuple(signal.unit for signal in outputs),
    )


def with_states(model: LinearSystem) -> LinearSystem:
    """Replace the terms that have states of their own by these, as coordinates with matrices.

    They are the last coordinates, term by term.
    """
    result = model
    while terms := result.terms_with_states:
        term = terms[0]
        others = tuple(one for one in result.terms if one is not term)
        result = replace(result, terms=others).widened(term.states())
    return result


def _unit(kind: str, model: LinearSystem, number: int) -> str:
    """Unit of a state of a kind, of a coordinate given by its number."""
    if kind == MOMENTUM:
        return model.momentum_unit[number]
    unit = model.unit[number]
    return f"{unit}/s" if kind == RATE else unit


@dataclass(frozen=True)
class _Part:
    """State space of one block, and the coordinates of its states by kind (suffix of the name)."""

    a: Float[np.ndarray, "state state"]
    b: Float[np.ndarray, "state input"]
    c: Float[np.ndarray, "output state"]
    d: Float[np.ndarray, "output input"]
    states: tuple[tuple[str, Int[np.ndarray, " _"]], ...]


def _block(
    block: Block,
    damping: Float[np.ndarray, "coordinate coordinate"],
    moves: Float[np.ndarray, "6 input"],
    forces: Float[np.ndarray, "coordinate input"],
    rows: Float[np.ndarray, "output coordinate"],
) -> _Part:
    """Build the state space of one block: inputs `moves` and `forces`, outputs `rows`.

    Tensions count as coordinates b without mass, as those of blade tips do. Where a damper resists
    such (of a massless support structure), its momenta p are states too:

        p = U^T (C_ba a + C_bb b + C_bs s),    p' = U^T (f - K_ba a - K_bb b - K_bs s),

    with U the directions that dampers resist. In the others the forces of springs balance; both
    conditions together determine b.
    """
    from scipy.linalg import qr

    keep = block.keep
    size = len(block.owner)
    at = np.ix_(keep, np.append(np.arange(6), keep))
    more = size - len(keep)
    mass, damping = (np.pad(matrix[at], (0, more)) for matrix in (block.pencil.model.mass, damping))
    force = np.pad(forces[keep], ((0, more), (0, 0)))
    sensed = np.pad(rows[:, keep], ((0, 0), (0, more)))
    stiffness = block.at(block.pencil.at(np.zeros(1))).matrix[..., 0]  # complex if lossy
    heavy = np.flatnonzero((mass[:, 6:] != 0).any(1))
    light = np.setdiff1d(np.arange(size), heavy)
    k = stiffness[:, 6:]
    c = damping[:, 6:]
    resisted, unresisted = _find_resisted(damping, light)
    rank = len(resisted)
    # coordinates q and what acts on them per states z, w, p and inputs u, side by side
    count = len(heavy)
    inputs = moves.shape[1]
    ends = np.cumsum([0, count, count, rank, inputs])
    z, w, p, u = (slice(n, m) for n, m in pairwise(ends))
    q, momentum, applied = np.zeros((3, size, ends[-1]), dtype=stiffness.dtype)
    inertia = mass[heavy[:, None], 6 + heavy]
    q[heavy, z] = np.eye(count)
    q[heavy, u] = -np.linalg.solve(inertia, mass[heavy, :6] @ moves)
    momentum[:, u] = damping[:, :6] @ moves
    applied[:, u] = force - stiffness[:, :6] @ moves
    both = np.concatenate([resisted @ c[light], unresisted @ k[light]])
    right = np.concatenate([-resisted @ momentum[light], unresisted @ applied[light]])
    right[:rank, p] = np.eye(rank)
    solve = np.linalg.inv(both[:, light])
    q[light] = _sum(solve @ right, -solve @ both[:, heavy], q[heavy])
    momentum = np.real(_sum(momentum, c, q))
    applied = np.real(_sum(applied, -k, q))
    rates = np.zeros((ends[-2], ends[-1]))
    rates[z] = -np.linalg.solve(inertia, momentum[heavy])
    rates[w] = np.linalg.solve(inertia, applied[heavy])
    rates[z, w] += np.eye(count)
    rates[p] = resisted @ applied[light]
    sensed = np.real(sensed @ q)
    leading = light[qr(resisted, mode="r", pivoting=True)[-1][:rank]] if rank else light[:0]
    states = ("", heavy), (RATE, heavy), (MOMENTUM, leading)
    names = tuple((kind, keep[which]) for kind, which in states)
    return _Part(rates[:, : u.start], rates[:, u], sensed[:, : u.start], sensed[:, u], names)


def _find_resisted(
    damping: Float[np.ndarray, "unknown all"], light: Int[np.ndarray, " light"]
) -> tuple[Float[np.ndarray, "direction light"], Float[np.ndarray, "direction light"]]:
    """Directions of unknowns without mass that dampers resist, and the others.

    Raises `InputError` if a damper pushes along one that it does not sense.
    """
    own = damping[np.ix_(light, 6 + light)]
    directions, _, _ = np.linalg.svd(own)
    limit = 1e-12 * np.abs(damping).max(initial=0.0)
    rank = int(np.linalg.matrix_rank(own, tol=limit)) if len(light) else 0
    resisted = directions[:, :rank].T
    unresisted = directions[:, rank:].T
    if np.abs(unresisted @ damping[light]).max(initial=0.0) > limit:
        problem = (
            "a damper pushes a support structure without mass along a motion that it does"
            " not sense, which leaves that motion undetermined"
        )
        raise InputError.of("control.loop", problem, "give [support] a mass and inertia")
    return resisted, unresisted


def _sum(
    direct: Inexact[np.ndarray, "row column"],
    matrix: Inexact[np.ndarray, "row inner"],
    shift: Inexact[np.ndarray, "inner column"],
) -> Inexact[np.ndarray, "row column"]:
    """Compute direct + matrix @ shift, exactly 0 where its terms cancel to rounding.

    A residue of 1e-16 would be a spurious coupling with transmission zeros of its own.
    """
    total = direct + matrix @ shift
    size = np.abs(direct) + np.abs(matrix) @ np.abs(shift)
    return np.where(np.abs(total) > 64 * np.finfo(float).eps * size, total, 0.0)


def _equivalent_damping(model: LinearSystem) -> Float[np.ndarray, "coordinate coordinate"]:
    """Viscous damping that gives each mode the Q of the loss angles.

    With modes v of unit modal mass, C = sum over modes of omega / Q (M v) (M v)^T.
    """
    if not model.is_lossy:
        return np.zeros(model.mass.shape)
    squared, per_q, momentum = _undamped_modes(replace(model, damping=0 * model.damping))
    return (momentum * np.sqrt(np.maximum(squared, 0.0)) * per_q) @ momentum.T


def _undamped_modes(
    model: LinearSystem,
) -> tuple[
    Float[np.ndarray, " mode"], Float[np.ndarray, " mode"], Float[np.ndarray, "coordinate mode"]
]:
    """omega^2, 1/Q (0 for an unstable mode) and momenta M v of modes v of unit modal mass."""
    solver = Solver(model)
    modes = solver.modes
    lossy = np.isfinite(modes.q) & (modes.omega_squared > 0)
    per_q = np.where(lossy, 1 / np.where(lossy, modes.q, 1.0), 0.0)
    return modes.omega_squared, per_q, model.mass @ solver.spectrum.motion.T


def with_constant_loss(model: LinearSystem) -> LinearSystem:
    """Replace terms that depend on frequency by a constant loss that gives every mode its Q.

    For a system without batch axes and without wires that have mass. State spaces and closed loops
    need constant matrices; terms with states, such as the light of cavities, stay. With mode shapes
    v of unit modal mass, K'' = sum over modes of (omega^2 / Q) (M v) (M v)^T keeps the width of
    each resonance. Between and far above the resonances the losses differ from the design's.
    """
    if not model.terms:
        return model
    stay = model.terms_with_states
    others = tuple(term for term in model.terms if not isinstance(term, TermWithStates))
    # dampers are constant already
    undamped = replace(model, damping=0 * model.damping, terms=others)
    squared, per_q, momentum = _undamped_modes(undamped)
    relative = np.eye(model.size)  # rigid motion is lossless
    relative[:, :6] = 0.0 if model.rigid is None else -model.rigid
    relative[:6, :6] = 0.0
    loss = relative.T @ ((momentum * (squared * per_q)) @ momentum.T) @ relative
    plain = replace(model.lossless, terms=stay)
    return replace(plain, soft=plain.soft + 0.5j * (loss + loss.T)) if per_q.any() else plain


@dataclass(frozen=True)
class Poles:
    """Poles of a linear system, one of each conjugate pair, in ascending order of modulus.

    Attributes
    ----------
    value
        rad/s.
    state
        The state that participates most in each pole.
    motion
        Motions of all coordinates in each pole; None if they were not asked for.
    """

    in_json: ClassVar = Layout(
        rows={"pole": ""},
        names={
            "value": "real_per_s imag_per_s",
            "frequency": "frequency_hz",
            "growth_rate": "growth_rate_per_s",
        },
        also="frequency q growth_rate",
        sparse="growth_rate",
    )
    value: Complex[np.ndarray, " pole"] = field(metadata=in_unit("rad/s"))
    state: tuple[str, ...] = field(metadata=along("pole"))
    motion: Complex[np.ndarray, "pole coordinate"] | None = field(default=None, metadata=NOT_STORED)

    @property
    def frequency(self) -> Float[np.ndarray, " pole"]:
        """Moduli over 2 pi, Hz."""
        return np.abs(self.value) / (2 * np.pi)

    @property
    def growth_rate(self) -> Float[np.ndarray, " pole"]:
        """Growth rates, 1/s; 0 for a stable pole."""
        return np.maximum(np.real(self.value), 0.0)

    @property
    def stable(self) -> bool:
        """Whether no pole has a growth rate."""
        return not self.growth_rate.any()

    @property
    def q(self) -> Float[np.ndarray, " pole"]:
        """Q = |p| / (-2 Re p): infinite if undamped, 1/2 if real, negative if unstable."""
        rate = np.real(self.value)
        return np.where(rate == 0, np.inf, np.abs(self.value) / np.where(rate == 0, 1.0, -2 * rate))


def find_poles(
    system: StateSpace,
) -> tuple[Poles, Complex[np.ndarray, "output pole"]]:
    """Compute the poles of a state space, and the outputs in each.

    Real parts that may be rounding errors are 0. A pole is named after a filter's state only if
    mechanical ones have less than `NAMED` of its participation.
    """
    if not len(system.a):
        none = np.zeros(0, dtype=complex)
        return Poles(none, ()), np.zeros((len(system.c), 0), dtype=complex)
    eigen: Any = np.linalg.eig(system.a)
    values = eigen.eigenvalues.astype(complex)
    right = eigen.eigenvectors
    participation = np.abs(right * np.linalg.pinv(right).T)
    upper_half = values.imag >= 0
    order = np.argsort(np.abs(values[upper_half]), kind="stable")
    mechanical = np.array([not is_of_filter(name) for name in system.state])[:, None]
    mechanical_fraction = (participation * mechanical).sum(0) / participation.sum(0)
    participation = np.where(mechanical | (mechanical_fraction < NAMED), participation, 0.0)
    leading = participation[:, upper_half].argmax(0)[order]
    names = tuple(system.state[n].removesuffix(RATE) for n in leading)
    values = values[upper_half][order]
    shapes = (system.c @ right)[:, upper_half][:, order]
    steady = np.abs(np.real(values)) <= ROUNDING * np.abs(values)
    return Poles(np.where(steady, 1j * np.imag(values), values), names), shapes


def impulse(
    system: StateSpace, time: Float[np.ndarray, " time"]
) -> Float[np.ndarray, "time output input"]:
    """Compute the response to unit impulses at evenly spaced times in s.

    A unit impulse is 1 N s, 1 m s, etc. Each sample follows from the last by exp(A dt), exact for
    any step; the direct feed-through, a delta function at 0, is omitted.
    """
    from scipy.linalg import expm

    step = expm(system.a * (time[1] - time[0])) if len(time) > 1 else np.eye(len(system.a))
    x = expm(system.a * time[0]) @ system.b
    result = []
    with np.errstate(over="ignore", invalid="ignore"):  # unstable systems overflow
        for _ in time:
            result.append(system.c @ x)
            x = step @ x
    return np.array(result)
