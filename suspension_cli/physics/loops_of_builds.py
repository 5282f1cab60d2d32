"""Poles and margins of the loops of many builds at once.

The undamped modes v_n of each build, of unit modal mass, diagonalise its equations

    (Lambda - omega^2 + i omega V^T C V + D(omega)) q + V^T P^T u = 0,

with D = V^T K'' V - R^T (K_tt + K''_tt)^-1 R for losses K''(omega), as coordinates t without mass
(blade tips) follow, R = (K'' V)_t. D is exact, and small.

**Poles.** Start values are the eigenvalues of the state space of modes and filters, in which
dampers give each mode its loss. Each is then a root of the equations with D at its own frequency
and with the exact filters, T(s) x = 0, by inverse iteration,

    T(s) y = T'(s) x,    s' = s - x^H x / (x^H y),

which converges with second order (Ruhe, SIAM J. Numer. Anal. 10, 674 (1973)). The inertia of
massive wires, in D too, is that at the frequency of oscillation, which is exact at the limit of
stability.

**Margins** are those of `margins.compute_margins_of_designs` with a sum over modes for the response
G from actuators to sensors. The eigenvalues of Lambda + D, with D of each mode at its own
frequency, have all of D but what it changes between resonances. What that does to a result is
known from G with the exact D at its frequency: to first order, the result is moved there.

A build for which an iteration, or such a move, is not small, is not done here: its results are NaN,
and `closed_loop` has them.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.elimination import solve_each
from suspension_cli.linear import batch_modes, quality, statespace
from suspension_cli.linear.matrix_terms import Damper, StructuralLoss
from suspension_cli.linear.roots import Feedback
from suspension_cli.linear.system import LinearSystem
from suspension_cli.linear.wire_term import WireTerm, is_massive
from suspension_cli.physics import (
    closed_loop,
    closed_loop_margins,
    local_control,
    loop_realisation,
    margins,
)
from suspension_cli.physics.local_control import Plant
from suspension_cli.physics.margins import Margins
from suspension_cli.physics.modes_with_loops import DampedModes
from suspension_cli.scene.arrays import Array, Index

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

CHUNK = 64
"""Builds whose margins are searched at once: their grids take some 100 MB."""
STEPS = 8
"""Most steps of the iteration of a pole (usually 2 or 3)."""
CONVERGED = 1e-9
"""Relative step at which it ends: the next one would be some 1e-18."""
STRAYED = 0.02
"""Relative distance from its start beyond which a pole may be another one."""
SAME = 1e-6
"""Relative distance of poles within which one may have been found twice."""
STEADY = 1e-9
"""Decay rate over the modulus of a pole below which it may be a rounding error."""
BESIDE = 1e-9
"""Relative step for the slope of a loop gain against frequency."""
UNCLEAR = 0.005
"""Relative distance from `statespace.NAMED` of a fraction that may be on either side."""
SMALL = 0.01
"""Largest relative correction of a loop gain whose square is neglected."""


def is_possible(model: LinearSystem) -> bool:
    """Whether the equations of builds have the form that is solved here.

    Terms that change little between resonances; no damping of coordinates without mass.
    """
    inert = model.massless
    if any(type(term) not in (WireTerm, StructuralLoss, Damper) for term in model.terms):
        return False
    dampers = [term.matrix for term in model.terms if isinstance(term, Damper)]
    return not any(np.any(matrix[..., inert, :]) for matrix in (model.damping, *dampers))


@dataclass(frozen=True)
class ClosedPoles:
    """Closed-loop poles of builds, rad/s, one of each conjugate pair.

    Attributes
    ----------
    value
        NaN where a build has fewer.
    motion
        Modes in each pole.
    mechanical
        Fraction of mechanical states in the participation of each pole, by which it is one of the
        suspension or of a filter (`statespace.find_poles`).
    known
        Whether the poles of a build were found.
    """

    value: Complex[np.ndarray, "build pole"]
    motion: Complex[np.ndarray, "build pole mode"]
    mechanical: Float[np.ndarray, "build pole"]
    known: Bool[np.ndarray, " build"]

    @property
    def stable(self) -> Bool[np.ndarray, " build"]:
        """Whether no pole of a build grows."""
        grows = np.real(self.value) > 0
        return ~np.asarray(grows.any(1))


class ModalBuilds:
    """Builds of a design with loops, in their undamped modes.

    Attributes
    ----------
    plant
        With the linear systems of all builds, which `is_possible` admits.
    """

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self.model = plant.model
        self.network = plant.network

    @property
    def count(self) -> int:
        """Number of builds."""
        return self.model.batch[0]

    @cached_property
    def spectrum(self) -> batch_modes.Spectrum:
        """Undamped modes."""
        return batch_modes.solve(self.model.constant)

    @property
    def squared(self) -> Float[np.ndarray, "build mode"]:
        """omega^2 of the modes, (rad/s)^2."""
        return self.spectrum.omega_squared

    @cached_property
    def shape(self) -> Float[np.ndarray, "build coordinate mode"]:
        """Shapes V of the modes."""
        return np.swapaxes(self.spectrum.motion, -1, -2)

    @cached_property
    def sensed(self) -> Float[np.ndarray, "build channel mode"]:
        """What channels read of modes."""
        return self.plant.sensed @ self.shape

    @cached_property
    def pushed(self) -> Float[np.ndarray, "build loop mode"]:
        """Forces of loops on modes."""
        return self.plant.pushed @ self.shape

    @cached_property
    def damping(self) -> Float[np.ndarray, "build mode mode"]:
        """Dampers between modes, 1/s."""
        dampers = [term.matrix for term in self.model.terms if isinstance(term, Damper)]
        whole = sum(dampers, self.model.damping)
        return np.swapaxes(self.shape, -1, -2) @ whole @ self.shape

    @cached_property
    def _lossy(self) -> LinearSystem:
        """The systems without what acts as a damper."""
        terms = tuple(term for term in self.model.terms if not isinstance(term, Damper))
        return replace(self.model, terms=terms)

    def losses(
        self, build: Int[np.ndarray, " point"], omega: Float[np.ndarray, " point"]
    ) -> Complex[np.ndarray, "point mode mode"]:
        """Compute D of builds at one frequency each, rad/s."""
        static = self.model.stiffness[build]
        model = self._lossy.select(build).at(omega)
        change = model.complete - static
        shape = self.shape[build]
        pulled = change @ shape
        result = np.swapaxes(shape, -1, -2) @ pulled
        tips = np.flatnonzero(self.model.massless[6:]) + 6
        if len(tips):
            own = (static + change)[:, tips[:, None], tips]
            rest = pulled[:, tips]
            result = result - np.swapaxes(rest, -1, -2) @ solve_each(own, rest)
        return result

    @cached_property
    def loss(self) -> Complex[np.ndarray, "build mode mode"]:
        """D of each mode at its own frequency, and between two the mean of both."""
        count = self.squared.shape[1]
        if not self._lossy.terms:
            return self.losses(np.arange(self.count), np.zeros(self.count))
        build = np.repeat(np.arange(self.count), count)
        omega = np.sqrt(np.maximum(self.squared, 0.0)).ravel()
        found = self.losses(build, omega).reshape(self.count, count, count, count)
        own = np.einsum("bnnm->bnm", found)
        return (own + np.swapaxes(own, -1, -2)) / 2

    @cached_property
    def residues(
        self,
    ) -> tuple[Complex[np.ndarray, "build root"], Complex[np.ndarray, "build root channel_loop"]]:
        """Roots z_n and matrices R_n of G = sum of R_n / (z_n - z).

        z is omega^2; with dampers i omega.
        """
        modes = self.squared.shape[1]
        stiffness = np.eye(modes) * self.squared[:, :, None] + self.loss
        pushed = np.swapaxes(self.pushed, -1, -2)
        sensed = self.sensed
        matrix = stiffness
        if self.damping.any():
            matrix = np.zeros((self.count, 2 * modes, 2 * modes), dtype=complex)
            matrix[:, :modes, modes:] = np.eye(modes)
            matrix[:, modes:, :modes] = -stiffness
            matrix[:, modes:, modes:] = -self.damping
            pushed = np.concatenate([np.zeros_like(pushed), -pushed], axis=1)
            sensed = np.concatenate([sensed, np.zeros_like(sensed)], axis=2)
        found: Any = np.linalg.eig(matrix)
        right = found.eigenvectors
        left = solve_each(right, np.broadcast_to(pushed, (*matrix.shape[:2], pushed.shape[2])))
        whole = np.einsum("bcn,bnl->bncl", sensed @ right, left)
        return found.eigenvalues, whole.reshape(*matrix.shape[:2], -1)

    def respond(
        self, build: Int[np.ndarray, " point"], frequency: Float[np.ndarray, " point"]
    ) -> Complex[np.ndarray, "point channel loop"]:
        """Sum modes for the responses G of ascending builds at frequencies in Hz."""
        root, residue = self.residues
        omega = 2 * np.pi * frequency
        z = 1j * omega if self.damping.any() else omega**2
        weight = 1 / (root[build] - z[:, None])
        result = np.empty((len(build), residue.shape[2]), dtype=complex)
        edges = [0, *(np.flatnonzero(np.diff(build)) + 1), len(build)]
        for start, stop in pairwise(edges):
            if start < stop:
                result[start:stop] = weight[start:stop] @ residue[build[start]]
        return result.reshape(len(build), self.sensed.shape[1], self.pushed.shape[1])

    def respond_exactly(
        self, build: Int[np.ndarray, " point"], frequency: Float[np.ndarray, " point"]
    ) -> Complex[np.ndarray, "point channel loop"]:
        """Solve for the responses G with the losses at each frequency in Hz."""
        omega = 2 * np.pi * frequency
        matrix = self.losses(build, omega) + 1j * omega[:, None, None] * self.damping[build]
        number = np.arange(matrix.shape[1])
        matrix[:, number, number] += self.squared[build] - omega[:, None] ** 2
        pushed = np.swapaxes(self.pushed, -1, -2)
        pushed = np.broadcast_to(pushed, (self.count, *pushed.shape[1:]))[build]
        sensed = np.broadcast_to(self.sensed, (self.count, *self.sensed.shape[1:]))[build]
        return sensed @ np.linalg.solve(matrix, pushed)

    def close(
        self, frequency: Float[np.ndarray, " point"], response: Complex[np.ndarray, "point c l"]
    ) -> Complex[np.ndarray, "point loop"]:
        """Compute the gain of each loop, the others closed, from G at frequencies in Hz."""
        return local_control.close_others(self.network.controllers(frequency) @ response)

    def gains(self, build: Index, frequency: Array) -> Complex[np.ndarray, "point loop"]:
        """Compute gains of loops, the others closed, from sums over modes."""
        with np.errstate(all="ignore"):
            result = self.close(frequency, self.respond(build, frequency))
            singular = ~np.isfinite(result).all(1)
            if singular.any():  # at a resonance without loss
                beside = frequency[singular] * (1 + local_control.BESIDE)
                result[singular] = self.close(beside, self.respond(build[singular], beside))
        return result

    def poles(self) -> ClosedPoles:
        """Find the poles with all loops closed."""
        start, states, mechanical = self._starts()
        delay = max(node.delay + node.filter.period for node in self.network.nodes)
        upper = np.imag(start) >= 0
        # a pole that decays within a delay may be one of the fraction that stands for it
        upper &= -np.real(start) * delay <= closed_loop.SURE
        start = self._move_filter_poles(start, upper & (mechanical < statespace.NAMED))
        wanted = upper & (start != 0)
        most = int(wanted.sum(1).max(initial=0))
        modes = self.squared.shape[1]
        value = np.full((self.count, most), complex(np.nan, np.nan))
        motion = np.full((self.count, most, modes), complex(np.nan, np.nan))
        fraction = np.full((self.count, most), np.nan)
        known = upper.sum(1) == wanted.sum(1)
        build, place = np.nonzero(wanted)
        column = (np.cumsum(wanted, axis=1) - 1)[build, place]
        found, shape, lost = self._iterate(build, start[build, place], states[build, :, place])
        value[build, column] = found
        motion[build, column] = shape[:, :modes]
        fraction[build, column] = mechanical[build, place]
        known[build[lost]] = False
        known &= ~_repeated(value, motion) & (self.squared > 0).all(1)
        return ClosedPoles(value, motion, fraction, known)

    def _starts(
        self,
    ) -> tuple[
        Complex[np.ndarray, "build state"],
        Complex[np.ndarray, "build unknown state"],
        Float[np.ndarray, "build state"],
    ]:
        """Compute eigenvalues of the state space, with modes and outputs of filters in each.

        Also returns the fractions of mechanical states in their participation.
        """
        from scipy.linalg import block_diag

        plant = self.plant
        made = loop_realisation.realise_nodes(plant)
        parts = [(one.A, one.B, one.C, one.D) for one in made]
        a, b, c, d = (np.asarray(block_diag(*each)) for each in zip(*parts, strict=True))
        reads = self.network.of_nodes
        sensed = self._node_sensed
        viscous = np.zeros(len(made))
        viscous[: len(plant.loops)] = [loop_realisation.viscous_damper(one) for one in plant.loops]
        through = np.linalg.inv(np.eye(len(made)) - d @ reads)
        from_motion = through @ d @ sensed
        from_states = through @ c
        modes = self.squared.shape[1]
        number = np.arange(modes)
        push = np.swapaxes(self._node_pushed, -1, -2)
        own = np.real(np.einsum("bnn->bn", self.loss)) + self.squared
        lag = np.imag(np.einsum("bnn->bn", self.loss))
        damping = self.damping + push @ (viscous[:, None] * sensed)
        oscillates = own > 0
        damping[:, number, number] += lag / np.sqrt(np.where(oscillates, own, np.inf))
        size = 2 * modes + len(a)
        matrix = np.zeros((self.count, size, size))
        rates = slice(modes, 2 * modes)
        states = slice(2 * modes, size)
        matrix[:, number, modes + number] = 1.0
        matrix[:, rates, :modes] = -push @ from_motion
        matrix[:, modes + number, number] -= own
        matrix[:, rates, rates] = -damping
        matrix[:, rates, states] = -push @ from_states
        matrix[:, states, :modes] = b @ (sensed + reads @ from_motion)
        matrix[:, states, states] = a + b @ reads @ from_states
        found: Any = np.linalg.eig(matrix)
        value = found.eigenvalues.astype(complex)
        vector = found.eigenvectors.astype(complex)
        motion = vector[:, :modes]
        forces = from_motion @ motion + from_states @ vector[:, states]
        forces = forces + viscous[:, None] * (sensed @ vector[:, rates])
        mechanical = self._mechanical_fractions(vector, damping)
        return value, np.concatenate([motion, forces], axis=1), mechanical

    def _move_filter_poles(
        self,
        start: Complex[np.ndarray, "build state"],
        of_filters: Bool[np.ndarray, "build state"],
    ) -> Complex[np.ndarray, "build state"]:
        """Move starts that are poles of digital filters to where these are."""
        parts = [part for node in self.network.nodes for part in node.filter.parts]
        poles = np.array([pole for part in parts for pole in part.poles])
        rates = np.array([part.rate for part in parts for _ in part.poles])
        if not rates.any():
            return start
        result = start.copy()
        for place in zip(*np.nonzero(of_filters), strict=True):
            rate = rates[np.abs(start[place] + 2 * np.pi * poles).argmin()]
            if rate:
                result[place] = closed_loop.move_pole(complex(start[place]), rate)
        return result

    def _mechanical_fractions(
        self,
        right: Complex[np.ndarray, "build state state"],
        damping: Float[np.ndarray, "build mode mode"],
    ) -> Float[np.ndarray, "build state"]:
        """Compute the fractions of mechanical states in the participation of eigenvectors.

        The states are those of `statespace.assemble`: coordinates z, and z' + M^-1 C z.
        """
        modes = damping.shape[1]
        left = np.linalg.inv(right)
        heavy = np.flatnonzero(~self.model.massless)
        heavy = heavy[heavy >= 6]
        to_all = self.shape[:, heavy]
        to_modes = np.linalg.inv(to_all)
        z, rate = right[:, :modes], right[:, modes : 2 * modes]
        by_z, by_rate = left[:, :, :modes], left[:, :, modes : 2 * modes]
        pairs = (z, by_z - by_rate @ damping), (rate + damping @ z, by_rate)
        participation = [
            np.abs((to_all @ x) * np.swapaxes(by @ to_modes, -1, -2)) for x, by in pairs
        ]
        filters = np.abs(right[:, 2 * modes :] * np.swapaxes(left[:, :, 2 * modes :], -1, -2))
        mechanical = sum(part.sum(1) for part in participation)
        return mechanical / (mechanical + filters.sum(1))

    @cached_property
    def _node_sensed(self) -> Float[np.ndarray, "build node mode"]:
        """What nodes of the network read of modes."""
        return self.network.of_channels @ self.sensed

    @cached_property
    def _node_pushed(self) -> Float[np.ndarray, "build node mode"]:
        """Forces of nodes on modes: those of loops alone push."""
        builds, loops, modes = self.pushed.shape
        result = np.zeros((builds, len(self.network.nodes), modes))
        result[:, :loops] = self.pushed
        return result

    def _iterate(
        self,
        build: Int[np.ndarray, " pole"],
        start: Complex[np.ndarray, " pole"],
        x: Complex[np.ndarray, "pole unknown"],
    ) -> tuple[
        Complex[np.ndarray, " pole"],
        Complex[np.ndarray, "pole unknown"],
        Bool[np.ndarray, " pole"],
    ]:
        """Find the roots near start values, with their shapes; mark those that are lost."""
        oscillates = np.imag(start) > 0
        loss = np.zeros((len(start), *self.loss.shape[1:]), dtype=complex)
        some = np.flatnonzero(oscillates)
        loss[some] = self.losses(build[some], np.imag(start[some]))
        value = start.copy()
        x = x.copy()
        lost = np.zeros(len(start), dtype=bool)
        moving = np.arange(len(start))
        for _ in range(STEPS):
            if not len(moving):
                break
            s = value[moving]
            own = x[moving]
            matrix, slope = self._equations(build[moving], s, loss[moving])
            right = (slope @ own[:, :, None])[:, :, 0]
            with np.errstate(all="ignore"):
                y = solve_each(matrix, right[:, :, None])[:, :, 0]
                step = (own.conj() * own).sum(1) / (own.conj() * y).sum(1)
                exact = ~np.isfinite(step)  # s is a root to the last bit
                value[moving] = np.where(exact, s, s - step)
                shape = y / np.sqrt((np.abs(y) ** 2).sum(1))[:, None]
                x[moving] = np.where(exact[:, None], own, shape)
                far = ~(np.abs(value[moving] - start[moving]) <= STRAYED * np.abs(start[moving]))
                done = exact | (np.abs(step) <= CONVERGED * np.abs(s))
            lost[moving[far]] = True
            moving = moving[~(done | far)]
        lost[moving] = True
        value = np.where(oscillates, self._refine_decays(build, value, loss, x), np.real(value))
        lost |= oscillates != (np.imag(value) > 0)
        lost |= np.abs(np.real(value)) <= STEADY * np.abs(value)
        return value, x, lost

    def _refine_decays(
        self,
        build: Int[np.ndarray, " pole"],
        value: Complex[np.ndarray, " pole"],
        loss: Complex[np.ndarray, "pole mode mode"],
        x: Complex[np.ndarray, "pole unknown"],
    ) -> Complex[np.ndarray, " pole"]:
        """Compute slow decays from dissipation and the power of loops (see `linear.quality`)."""
        omega = np.imag(value)
        slow = np.abs(np.real(value)) <= quality.SLOW * omega
        modes = loss.shape[1]
        q = x[:, :modes]
        resisting = loss + 1j * omega[:, None, None] * self.damping[build]
        lost = np.einsum("pn,pnm,pm->p", q.conj(), resisting, q)
        pushed = np.einsum("pkn,pn->pk", self._node_pushed[build], q)
        power = np.imag(lost + (pushed.conj() * x[:, modes:]).sum(1))
        inertia = (np.abs(q) ** 2).sum(1)
        sigma = -power / np.where(slow, 2 * omega * inertia, 1.0)
        return np.where(slow, sigma + 1j * omega, value)

    def _equations(
        self,
        build: Int[np.ndarray, " pole"],
        s: Complex[np.ndarray, " pole"],
        loss: Complex[np.ndarray, "pole mode mode"],
    ) -> tuple[
        Complex[np.ndarray, "pole unknown unknown"], Complex[np.ndarray, "pole unknown unknown"]
    ]:
        """Compute T(s) and T'(s) of builds; the unknowns are modes and outputs of filters."""
        modes = loss.shape[1]
        nodes = len(self.network.nodes)
        matrix = np.zeros((len(s), modes + nodes, modes + nodes), dtype=complex)
        slope = np.zeros_like(matrix)
        number = np.arange(modes)
        damping = self.damping[build]
        matrix[:, :modes, :modes] = loss + s[:, None, None] * damping
        matrix[:, number, number] += self.squared[build] + s[:, None] ** 2
        matrix[:, :modes, modes:] = np.swapaxes(self._node_pushed[build], -1, -2)
        slope[:, :modes, :modes] = damping
        slope[:, number, number] += 2 * s[:, None]
        sensed = self._node_sensed[build]
        for n, node in enumerate(self.network.nodes):
            functions = Feedback(NONE, NONE, NONE, node.filter, node.delay).at(s)
            for to, (_, over, under) in zip((matrix, slope), functions, strict=True):
                to[:, modes + n, :modes] = over[:, None] * sensed[:, n]
                to[:, modes + n, modes:] = over[:, None] * self.network.of_nodes[n]
                to[:, modes + n, modes + n] -= under
        return matrix, slope

    def margins(self, poles: Sequence[Complex[np.ndarray, " pole"]]) -> list[list[Margins] | None]:
        """Find the margins of each loop of stable builds, given their poles.

        None of builds that are not done here.
        """
        corners = [closed_loop_margins.find_corner_frequencies(self.network, one) for one in poles]
        found = margins.compute_margins_of_designs(self.gains, corners)
        return self._correct(found)

    def _correct(self, found: list[list[Margins]]) -> list[list[Margins] | None]:
        """Correct margins by what the losses at their own frequencies change."""
        places = [
            (build, loop, kind, place)
            for build, loops in enumerate(found)
            for loop, one in enumerate(loops)
            for kind in PLACED
            if self.network.nodes[loop].filter.gain != 0
            if (place := getattr(one, f"{kind}_frequency")) > 0
        ]
        result: list[list[Margins] | None] = [list(one) for one in found]
        if not places:
            return result
        build, loop, kind, frequency = (np.array(column) for column in zip(*places, strict=True))
        pairs, where = np.unique(np.stack([build, frequency]), axis=1, return_inverse=True)
        owner = pairs[0].astype(int)
        place = pairs[1]
        exact = self.close(place, self.respond_exactly(owner, place))[where, loop]
        near = self.gains(owner, place)[where, loop]
        beside = self.gains(owner, place * (1 + BESIDE))[where, loop]
        slope = np.log(beside / near) / (BESIDE * frequency)
        size = np.log(np.abs(exact))
        angle = np.angle(-exact)
        with np.errstate(all="ignore"):
            to_unity = -size / np.real(slope)
            to_real = -angle / np.imag(slope)
        at_unity = np.isin(kind, ("phase", "delay"))
        shift = np.where(at_unity, to_unity, np.where(kind == "distance", 0.0, to_real))
        angle = angle + np.imag(slope) * shift
        factor = np.exp(-size - np.real(slope) * shift)
        moved = frequency + shift
        values = {
            "phase": np.abs(np.degrees(angle)),
            "delay": np.mod(angle, 2 * np.pi) / (2 * np.pi * moved),
            "gain_up": factor,
            "gain_down": factor,
            "distance": np.abs(1 + exact),
        }
        # NaN is not small either
        small = (np.abs(exact / near - 1) < SMALL) & (np.abs(slope * shift) < SMALL)
        for n, (own, number, name, _) in enumerate(places):
            loops = result[own]
            if not small[n]:
                result[own] = None
            elif loops is not None:
                new = {name: float(values[name][n]), f"{name}_frequency": float(moved[n])}
                loops[number] = replace(loops[number], **new)
        return result


PLACED = ("phase", "delay", "gain_up", "gain_down", "distance")
"""Margins that are found at a frequency."""
NONE = np.zeros(0)
"""Stands for what filters read and push, which their functions do not depend on."""


def _close_pairs(
    value: Complex[np.ndarray, "build pole"],
) -> Bool[np.ndarray, "build pole pole"]:
    """Mark poles that are close to one before them."""
    near = np.abs(value[:, :, None] - value[:, None]) <= SAME * np.abs(value[:, None])
    return np.tril(near, -1)


def _repeated(
    value: Complex[np.ndarray, "build pole"], motion: Complex[np.ndarray, "build pole mode"]
) -> Bool[np.ndarray, " build"]:
    """Find builds in which a pole was found twice: its shape too."""
    with np.errstate(all="ignore"):  # filters alone have none
        shape = motion / np.sqrt((np.abs(motion) ** 2).sum(2))[:, :, None]
        alike = np.abs(shape.conj() @ np.swapaxes(shape, -1, -2)) > 1 - SAME
    return np.asarray((_close_pairs(value) & alike).any((1, 2)))


@dataclass(frozen=True)
class ClosedBuilds:
    """Some builds with their loops closed, by number among all."""

    number: Int[np.ndarray, " build"]
    builds: ModalBuilds
    poles: ClosedPoles

    @staticmethod
    def of(number: Int[np.ndarray, " build"], plant: Plant) -> ClosedBuilds:
        """Close the loops of some builds of all those of a plant."""
        builds = ModalBuilds(plant.select_builds(number))
        return ClosedBuilds(number, builds, builds.poles())

    def margins(self) -> tuple[Int[np.ndarray, " good"], Float[np.ndarray, "good loop margin"]]:
        """Compute the margins of those stable builds that are done here, and their numbers."""
        good = np.flatnonzero(self.poles.known & self.poles.stable)
        loops = len(self.builds.plant.loops)
        none = np.zeros((0, loops, len(closed_loop_margins.MARGINS)))
        if not len(good):
            return good, none
        builds = self.builds
        if len(good) < len(self.number):
            builds = ModalBuilds(builds.plant.select_builds(good))
        values = [value[np.isfinite(value)] for value in self.poles.value[good]]
        found: list[list[Margins] | None] = []
        with contextlib.suppress(np.linalg.LinAlgError):  # a pole on the imaginary axis
            found = builds.margins(values)
        done = [n for n, one in enumerate(found) if one is not None]
        rows = [closed_loop_margins.tabulate_margins(one) for one in found if one is not None]
        return self.number[good[done]], np.array(rows).reshape(-1, *none.shape[1:])

    def modes(self) -> dict[int, DampedModes]:
        """Find the modes of those builds that are done here, by number, as `closed_loop` does."""
        builds = self.builds
        late = any(node.delay or node.filter.period for node in builds.network.nodes)
        if late or any(map(is_massive, builds.model.terms)):
            return {}
        fraction = self.poles.mechanical
        unclear = (np.abs(fraction / statespace.NAMED - 1) < UNCLEAR).any(1)
        # shapes of a degenerate pair, by which names find modes, are not determined
        unclear |= _close_pairs(self.poles.value).any((1, 2))
        result = {}
        for n in np.flatnonzero(self.poles.known & ~unclear).tolist():
            # NaN where there is no pole
            bodily = np.flatnonzero(fraction[n] >= statespace.NAMED)
            order = bodily[np.argsort(np.abs(self.poles.value[n, bodily]), kind="stable")]
            motion = self.poles.motion[n, order] @ builds.shape[n].T
            value = self.poles.value[n, order]
            model = builds.model.select(n)
            result[int(self.number[n])] = DampedModes.of_poles(value, motion, model)
        return result


def close_builds(model: LinearSystem, design: Design) -> list[ClosedBuilds]:
    """Close the loops of builds of a design, given by their linear systems.

    Returns none if `is_possible` does not admit them.
    """
    if not is_possible(model):
        return []
    plant = local_control.build_plant(design, model)
    if not plant.loops:
        return []
    every = np.arange(model.batch[0])
    result = []
    for start in range(0, len(every), CHUNK):
        with contextlib.suppress(np.linalg.LinAlgError):
            result.append(ClosedBuilds.of(every[start : start + CHUNK], plant))
    return result
