"""The systems of many builds, ready to be solved at any frequency."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import FRAME, SUPPORT
from suspension_cli.linear.small_matrices import solve_each
from suspension_cli.linear.static_condensation import condense
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models.batch_terms import BatchTerm
from suspension_cli.scene.arrays import Index

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Inexact, Int


@dataclass(frozen=True)
class Systems:
    """K + i omega C - omega^2 M of builds, massless undamped coordinates (blade tips) eliminated.

    With them LU loses digits: the error of the vertical motion of an imperfect triple at 50 Hz is
    4e-11 with them and 1e-14 without.

    Attributes
    ----------
    keep, drop
        Coordinates of the model without the support's; bodies from the top down, blades with the
        stage that hangs on them.
    stiffness, mass, damping
        With respect to the support's coordinates and their own.
    yielding, follow
        K_bb^-1 of the eliminated coordinates b, and K_bb^-1 times their stiffness against the rest.
    """

    keep: Int[np.ndarray, " kept"]
    drop: Int[np.ndarray, " dropped"]
    stiffness: Inexact[np.ndarray, "system kept 6+kept"]
    mass: Float[np.ndarray, "system kept 6+kept"]
    damping: Float[np.ndarray, "system kept 6+kept"]
    yielding: Inexact[np.ndarray, "system dropped dropped"]
    follow: Inexact[np.ndarray, "system dropped 6+kept"]

    @staticmethod
    def of(
        model: LinearSystem,
        which: Int[np.ndarray, " system"],
        dispersive: Complex[np.ndarray, "system coordinate coordinate"] | None = None,
    ) -> Systems:
        """Set up the systems of some builds, with an added `dispersive` stiffness."""
        owner, known = (
            [name.split(".", 1)[0] for name in model.coordinate],
            (SUPPORT, FRAME, *model.body),
        )
        order = np.argsort([known.index(name) for name in owner], kind="stable")[6:]
        damped = (model.damping != 0).any(-1).reshape(-1, model.size).any(0)
        light = (model.massless & ~damped)[order]
        keep, drop = order[~light], order[light]
        both = np.concatenate([np.arange(6), keep])

        def some(matrix: np.ndarray, rows: Index, columns: Index) -> np.ndarray:
            whole = np.broadcast_to(matrix, (*model.batch, model.size, model.size))
            return whole[which[:, None, None], rows[:, None], columns]

        full = model.stiffness if model.lossy is None else model.lossy

        def stiff(rows: Index, columns: Index) -> np.ndarray:
            constant = some(full, rows, columns)
            return (
                constant if dispersive is None else constant + dispersive[:, rows[:, None], columns]
            )

        mass, damping = some(model.mass, keep, both), some(model.damping, keep, both)
        found = condense(stiff(order, np.concatenate([np.arange(6), order])), light)
        return Systems(
            keep - 6, drop - 6, found.matrix, mass, damping, found.compliance, found.follow
        )

    def solve(
        self,
        omega: Float[np.ndarray, "*frequency"],
        moves: Float[np.ndarray, "system 6 input"],
        forces: Float[np.ndarray, "system coordinate input"],
    ) -> Inexact[np.ndarray, "system frequency coordinate input"]:
        """Solve for the coordinates, in the model's order, for motions of the support and forces.

        The frequencies, rad/s, are (f,) for all builds, or (p, f).
        """
        dynamic = self.stiffness[:, None] - (omega**2)[..., None, None] * self.mass[:, None]
        if self.damping.any():
            dynamic = dynamic + (1j * omega)[..., None, None] * self.damping[:, None]
        pushed = (
            forces[:, self.keep] - np.swapaxes(self.follow[..., 6:], -1, -2) @ forces[:, self.drop]
        )
        right = pushed[:, None] - dynamic[..., :6] @ moves[:, None]
        size = len(self.keep)
        kept = solve_each(
            dynamic[..., 6:].reshape(-1, size, size), right.reshape(-1, size, right.shape[-1])
        ).reshape(right.shape)
        result = np.empty(
            (*right.shape[:2], size + len(self.drop), right.shape[-1]), dtype=kept.dtype
        )
        result[:, :, self.keep] = kept
        given = np.concatenate(
            [np.broadcast_to(moves[:, None], (*right.shape[:2], *moves.shape[1:])), kept], axis=-2
        )
        result[:, :, self.drop] = (self.yielding @ forces[:, self.drop])[:, None] - self.follow[
            :, None
        ] @ given
        return result


def respond(
    model: LinearSystem,
    terms: tuple[BatchTerm, ...],
    which: Int[np.ndarray, " build"],
    omega: Float[np.ndarray, " frequency"],
    moves: Float[np.ndarray, "every 6 input"],
    forces: Float[np.ndarray, "every coordinate input"],
) -> Inexact[np.ndarray, "build frequency coordinate input"]:
    """Solve for the coordinates of builds `which` for motions of the support and forces on bodies.

    `terms` are the frequency-dependent parts of the model; `omega` in rad/s; `moves` and `forces`
    are those of all builds of the model.
    """
    every, each = np.repeat(which, len(omega)), np.tile(omega, len(which))
    added, compliance = evaluate_terms(model, terms, every, each)
    left = np.ones(len(every), dtype=bool)
    result = np.empty((len(every), model.size - 6, moves.shape[-1]), dtype=complex)
    if model.separated is not None:
        result, good = _respond_compiled(model, every, each, added, compliance, moves, forces)
        left = ~good
    if left.any():
        some = every[left]
        dispersive = further_stiffness(model, terms, some, each[left]) if terms else None
        found = Systems.of(model, some, dispersive).solve(
            each[left][:, None], moves[some], forces[some]
        )
        result = result.astype(np.result_type(result, found), copy=False)
        result[left] = found[:, 0]
    return result.reshape(len(which), len(omega), *result.shape[1:])


def evaluate_terms(
    model: LinearSystem,
    terms: tuple[BatchTerm, ...],
    which: Int[np.ndarray, " system"],
    omega: Float[np.ndarray, " system"],
) -> tuple[
    Complex[np.ndarray, "system coordinate coordinate"] | None, Inexact[np.ndarray, "system wire"]
]:
    """Compute the further stiffness of builds, each at a frequency, and the compliance of wires."""
    compliance: np.ndarray = np.zeros((len(which), 0))
    if model.separated is not None:
        stiffness = np.broadcast_to(model.separated.stiffness, (*model.batch, len(model.wire)))
        compliance = 1 / stiffness[which]
    if not terms:
        return None, compliance
    compliance = compliance.astype(complex)
    added = np.zeros((len(which), model.size, model.size), dtype=complex)
    for term in terms:
        term.add(added, compliance, omega, which)
    return added, compliance


def further_stiffness(
    model: LinearSystem,
    terms: tuple[BatchTerm, ...],
    which: Int[np.ndarray, " system"],
    omega: Float[np.ndarray, " system"],
) -> Complex[np.ndarray, "system coordinate coordinate"]:
    """Compute the frequency-dependent parts of builds, each at a frequency in rad/s.

    They include the stretching of wires.
    """
    added, compliance = evaluate_terms(model, terms, which, omega)
    if added is None:
        return np.zeros((len(which), model.size, model.size), dtype=complex)
    if model.separated is not None:
        form, stiffness = model.separated.form[which], model.separated.stiffness
        stiffness = np.broadcast_to(stiffness, (*model.batch, len(model.wire)))[which]
        change = 1 / compliance - stiffness
        added = added + (np.swapaxes(form, -1, -2) * change[:, None]) @ form
    return added


def _respond_compiled(
    model: LinearSystem,
    which: Int[np.ndarray, " system"],
    omega: Float[np.ndarray, " system"],
    added: Complex[np.ndarray, "system 6+coordinate 6+coordinate"] | None,
    compliance: Inexact[np.ndarray, "system wire"],
    moves: Float[np.ndarray, "every 6 input"],
    forces: Float[np.ndarray, "every coordinate input"],
) -> tuple[Inexact[np.ndarray, "system coordinate input"], Bool[np.ndarray, " system"]]:
    """Solve for the coordinates of systems by compiled loops; also, where these could."""
    from suspension_cli.compiled import constant  # takes half a second
    from suspension_cli.linear import compiled

    separated = model.separated
    assert separated is not None
    damped = (model.damping != 0).any(-1).reshape(-1, model.size).any(0)
    light = (model.massless & ~damped)[6:]
    order = 6 + np.concatenate([np.flatnonzero(~light), np.flatnonzero(light)])
    lossy = added is not None or damped.any() or np.iscomplexobj(separated.soft)
    kind = complex if lossy else float
    batch, size = model.batch, model.size
    whole, none = (*batch, size, size), np.zeros((0, size, size))
    matrices = compiled.Matrices(
        soft=constant(np.real(separated.soft)),
        mass=constant(model.mass, whole),
        loss=constant(np.imag(separated.soft) if np.iscomplexobj(separated.soft) else none),
        damping=constant(model.damping, whole) if damped.any() else constant(none),
        form=constant(separated.form),
    )
    systems = compiled.Systems(
        which,
        constant(omega),
        constant(none.astype(kind) if added is None else added),
        constant(compliance.astype(kind, copy=False)),
    )
    result = np.empty((len(which), size - 6, moves.shape[-1]), dtype=kind)
    good = np.empty(len(which), dtype=bool)
    compiled.respond(
        order,
        int((~light).sum()),
        # the factors of heavy tips on nearly rigid wires have few digits
        1 if light[6 * len(model.body) :].all() else 2,
        1j if lossy else 0.0,
        matrices,
        systems,
        constant(moves),
        constant(forces),
        result,
        good,
    )
    return result, good
