"""Sections of wire joined end to end, by elimination of the nodes between them; uniform rods.

>>> rods = np.array([[2.0, 2.0], [0.0, 0.0], [0.0, 0.0]])  # two springs of 2 N/m in series
>>> join_rods(rods).stiffness  # 1 N/m between the ends, nothing to the ground
array([1., 0., 0.])

Beams are joined in the coordinates q = (W, T_s, phi, d) of `elements.tensioned_beam`: deflection in
the middle of the chord, half the difference of the slopes of the ends, slope of the chord, and mean
slope of the ends relative to it. Without inertia W and phi have no stiffness but T L phi^2 / 2,
which no stiffness here includes, and (T_s, d) alone are joined. The slopes of the two ends relative
to the chord are a = d - T_s and b = d + T_s.

Two beams of lengths L_A (above) and L_B meet in a node, which is eta off the chord of the whole and
leans by zeta against it. The motion of both parts is

    W_A = W - L_B phi / 2 + eta / 2,                 W_B = W + L_A phi / 2 + eta / 2,
    phi_A = phi + eta / L_A,                         phi_B = phi - eta / L_B,
    a_A = a - eta / L_A,  b_A = zeta - eta / L_A,    a_B = zeta + eta / L_B,  b_B = b + eta / L_B,

q_A = P_A (q, eta, zeta) and q_B likewise; their chords add T_A L_A phi_A^2 + T_B L_B phi_B^2, the
mean tension of the whole excepted. No force on the node gives (eta, zeta) = N q from
P_A^T K_A P_A + P_B^T K_B P_B, and with M = P [1; N] the whole is M_A^T K_A M_A + M_B^T K_B M_B. An
error of N enters in its square, as no force acts on the node. EI / L_A^3 of a short section
multiplies only its small deformation; in the usual difference of stiffnesses of the ends it would
swamp the tension and the longer section. A stiffness D between the node and the ground (a damper)
adds D w^2, with the motion w = W + (L_A - L_B) phi / 2 + eta of the node.

The number of resonances of the clamped wire below this frequency exceeds that of its parts by the
number of negative eigenvalues of the stiffness of (eta, zeta) (Wittrick and Williams, Q. J. Mech.
Appl. Math. 24, 263 (1971)).

A uniform rod that is stretched or twisted obeys

    S u'' + mu omega^2 u = 0:   S = EA for stretching (u in m), GJ + T I_p/A for twisting (u in
                                rad).

With the even motion of the ends U_s = (u_1 + u_2)/2, the odd one U_a = (u_2 - u_1)/2,
kappa^2 = mu omega^2 / S and h = L/2, the stiffness is diagonal (any text on vibrations):

    even: -2 S kappa tan(kappa h),    odd: 2 S kappa / tan(kappa h).

Rods are joined as springs between their ends and springs from each end to the ground (`join_rods`):
in the sum of both, the stiffness of a nearly rigid wire would swamp its inertia.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from suspension_cli.elimination import multiply_real

if TYPE_CHECKING:
    from collections.abc import Sequence

    from jaxtyping import Float, Inexact, Int

EPS = 2.0**-53
ENDS = {
    2: np.array([[1.0, 0, -1, 0], [0, -1, 0, 1], [1, 0, 1, 0], [0, 1, 0, 1]]),
    1: np.array([[1.0, -1], [1, 1]]),
}
"""By p, the matrix from even and odd motion to the two ends: (W_s, T_s, W_a, T_a) of
`elements.tensioned_beam` to (w_1, w'_1, w_2, w'_2), and (U_s, U_a) of a rod to (u_1, u_2)."""


class Joined(NamedTuple):
    """Sections joined to a whole."""

    stiffness: Inexact[np.ndarray, "*elements"]
    """Of beams on (W, T_s, phi, d) or (T_s, d), of rods their springs."""
    motions: list[tuple[Inexact[np.ndarray, "end end pair *#shape"], ...]]
    """By round, the motion of upper and lower parts per motion of the joined pairs."""
    negative: Int[np.ndarray, "*shape"] | int
    """Number of negative eigenvalues of the stiffnesses of the nodes."""


def join(
    parts: Inexact[np.ndarray, "end end section *shape"],
    tensions: Inexact[np.ndarray, "section *#shape"],
    lengths: Inexact[np.ndarray, "section *#shape"],
    held: Inexact[np.ndarray, "node *#shape"] | None = None,
) -> Joined:
    """Join sections of a beam in pairs, then the pairs, until one is left.

    `parts` are the stiffness of each section on (W, T_s, phi, d), or on (T_s, d) without inertia,
    from the top; tensions and lengths are in N and m. `held` is a stiffness between each node and
    the ground, N/m, of sections with inertia.
    """
    motions = []
    negative = 0
    kept = slice(None) if len(parts) == 4 else slice(1, None, 2)
    while parts.shape[2] > 1:
        paired = parts.shape[2] // 2 * 2
        (l_a, l_b), (t_a, t_b) = (
            (each[0:paired:2], each[1:paired:2]) for each in (lengths, tensions)
        )
        above, below = (parts[:, :, start:paired:2] for start in (0, 1))
        upper, lower = (form[kept] for form in _node_forms(l_a, l_b, kept))
        # forces on the node per coordinate of the whole and of the node
        one, other = (
            multiply(form[:, -2:].swapaxes(0, 1), multiply(part, form))
            for form, part in ((upper, above), (lower, below))
        )
        node = one + other
        string = t_a / l_a + t_b / l_b
        step = t_a - t_b
        node[0, -2] += string
        massive = len(parts) == 4
        if massive:
            node[0, 2] += step
        place = (l_a - l_b) / 2  # of the node below the middle of the whole
        if held is not None:
            node[0, [0, -2]] += held[::2]
            node[0, 2] += held[::2] * place
        (ee, ez), (_, zz) = node[:, -2:]
        det = ee * zz - ez**2
        det = np.where(det == 0, EPS * np.abs(ee * zz), det)  # at a resonance: just beside it
        if not np.iscomplexobj(det):
            one_negative = det < 0
            both_negative = ~one_negative & (ee + zz < 0)
            negative = negative + (one_negative + 2 * both_negative).sum(0)
        # the motion of a node on which no force is left
        eta = (ez * node[1, :-2] - zz * node[0, :-2]) / det
        zeta = (ez * node[0, :-2] - ee * node[1, :-2]) / det
        upper, lower = (
            form[:, :-2] + form[:, -2, None] * eta + form[:, -1, None] * zeta
            for form in (upper, lower)
        )
        motions.append((upper, lower))
        pairs = _congruence(upper, above) + _congruence(lower, below) + string * eta[:, None] * eta
        if massive:
            pairs[2] += step * eta
            pairs[:, 2] += step * eta
        if held is not None:
            moved = eta.copy()
            moved[0] += 1
            moved[2] += place
            pairs += held[::2] * moved[:, None] * moved
            held = held[1::2]
        length = l_a + l_b
        tension = (t_a * l_a + t_b * l_b) / length
        pairs = (pairs + pairs.swapaxes(0, 1)) / 2
        parts = np.concatenate([pairs, parts[:, :, paired:]], axis=2)
        lengths = np.concatenate([length, lengths[paired:]])
        tensions = np.concatenate([tension, tensions[paired:]])
    return Joined(parts[:, :, 0], motions, negative)


def cut(
    places: tuple[tuple[int, int], ...],
    elements: Sequence[Inexact[np.ndarray, "2 frequency"]],
    tension: float,
    lengths: Sequence[float],
    motion: Inexact[np.ndarray, "coordinate motion frequency"],
) -> Inexact[np.ndarray, "2 coordinate motion frequency"]:
    """Motions of the two parts of a section that is cut, in motions of the section.

    In the coordinates of `join`. The parts, from the top, have the same tension (N), their lengths
    (m), and elements of their stiffness at `places`. No force acts on the node between them.
    """
    kept = slice(None) if len(motion) == 4 else slice(1, None, 2)
    above, below = (np.asarray(length) for length in lengths)
    forms = [form[kept] for form in _node_forms(above, below, kept)]
    clamped = [_transform(form[:, :-2], motion) for form in forms]  # with the node at rest
    node = np.zeros((2, 2, motion.shape[-1]), dtype=complex)
    node[0, 0] = tension / lengths[0] + tension / lengths[1]
    force = np.zeros((2, *motion.shape[1:]), dtype=complex)
    for n, (form, moved) in enumerate(zip(forms, clamped, strict=True)):
        own = [value[n] for value in elements]
        of_node = form[:, -2:]
        node += _transform(of_node.T, _force(places, own, of_node[..., None]))
        force += _transform(of_node.T, _force(places, own, moved))
    (ee, ez), (_, zz) = node
    det = ee * zz - ez**2
    det = np.where(det == 0, EPS * np.abs(ee * zz), det)  # at a resonance: just beside it
    free = np.array([ez * force[1] - zz * force[0], ez * force[0] - ee * force[1]]) / det
    parts = zip(forms, clamped, strict=True)
    return np.array([moved + _transform(form[:, -2:], free) for form, moved in parts])


def _transform(
    form: Float[np.ndarray, "row column"],
    motion: Inexact[np.ndarray, "column motion frequency"],
) -> Inexact[np.ndarray, "row motion frequency"]:
    """Multiply motions by a real matrix."""
    return multiply_real(form, motion.reshape(len(motion), -1)).reshape(-1, *motion.shape[1:])


def _force(
    places: tuple[tuple[int, int], ...],
    elements: Sequence[Inexact[np.ndarray, " frequency"]],
    motion: Inexact[np.ndarray, "coordinate motion #frequency"],
) -> Inexact[np.ndarray, "coordinate motion frequency"]:
    """Multiply a symmetric stiffness, of which the elements at `places` are given, by motions."""
    result = np.zeros((*motion.shape[:2], len(elements[0])), dtype=complex)
    for (i, j), value in zip(places, elements, strict=True):
        result[i] += value * motion[j]
        if i != j:
            result[j] += value * motion[i]
    return result


def _congruence(
    form: Inexact[np.ndarray, "row column pair *#shape"],
    matrix: Inexact[np.ndarray, "row row pair *shape"],
) -> Inexact[np.ndarray, "column column pair *shape"]:
    """P^T K P of matrices in the first two axes."""
    return multiply(form.swapaxes(0, 1), multiply(matrix, form))


def multiply(
    a: Inexact[np.ndarray, "row inner *#shape"], b: Inexact[np.ndarray, "inner column *#shape"]
) -> Inexact[np.ndarray, "row column *shape"]:
    """Multiply matrices in the first two axes: for such small ones quicker than `einsum`."""
    total = a[:, 0, None] * b[0]
    for n in range(1, len(b)):
        total += a[:, n, None] * b[n]
    return total


def _node_forms(
    above: Inexact[np.ndarray, "pair *#shape"],
    below: Inexact[np.ndarray, "pair *#shape"],
    kept: slice,
) -> tuple[
    Inexact[np.ndarray, "4 _ pair *#shape"],
    Inexact[np.ndarray, "4 _ pair *#shape"],
]:
    """P_A and P_B of pairs of beams of given lengths (m), per coordinate that is kept."""
    forms = []
    for other, slope, sign in ((-below, 1 / above, 1), (above, -1 / below, -1)):
        form = np.zeros((4, 6, *slope.shape), dtype=slope.dtype)
        form[0, 0] = 1
        form[0, 2] = other / 2
        form[0, 4] = 0.5
        form[2, 2] = 1
        form[2, 4] = slope
        form[3, 4] = -slope
        # (b - a) / 2 and (a + b) / 2, where zeta is the slope of one end
        form[1, 1] = form[1, 3] = form[3, 1] = form[3, 3] = form[3, 5] = 0.5
        form[1, 5] = 0.5 * sign
        form[3, 1] = -0.5 * sign
        form[1, 3] = -0.5 * sign
        forms.append(np.concatenate([form[:, :4][:, kept], form[:, 4:]], axis=1))
    return forms[0], forms[1]


def rod_stiffness(
    rigidity: Inexact[np.ndarray, "*#shape"],
    mass: Inexact[np.ndarray, "*#shape"],
    half: Inexact[np.ndarray, "*#shape"],
    omega: Inexact[np.ndarray, "*#shape"],
) -> Inexact[np.ndarray, "2 ..."]:
    """Dynamic stiffness of uniform rods on U_s and U_a, N/m or N m/rad.

    From S (N or N m^2; complex with loss), inertia per length (kg/m or kg m), half the length (m)
    and omega (rad/s). Sections may be an axis in front of the frequencies.
    """
    kappa2 = mass * omega**2 / rigidity + 0 * omega
    angle = np.sqrt(kappa2) * half
    zero = angle == 0
    tanc = np.where(
        zero, 1.0, np.tan(angle) / np.where(zero, 1.0, angle)
    )  # tan(kappa h) / (kappa h)
    return np.stack([-2 * rigidity * kappa2 * half * tanc, 2 * rigidity / half / tanc])


def rod_resonances_below(
    rigidity: Float[np.ndarray, "*#shape"],
    mass: Float[np.ndarray, "*#shape"],
    half: Float[np.ndarray, "*#shape"],
    omega: Float[np.ndarray, "*#shape"],
) -> Int[np.ndarray, "*shape"]:
    """Count the resonances of the clamped rod below each omega, at kappa L = pi, 2 pi, ... ."""
    turns = np.sqrt(mass / rigidity) * np.asarray(omega) * 2 * half / np.pi
    return np.ceil(turns - 1).clip(0).astype(int)


def join_rods(springs: Inexact[np.ndarray, "3 section *shape"]) -> Joined:
    """Join sections of a rod.

    A section is a spring c between its ends, and springs r_1 and r_2 from its ends to the ground
    (its inertia). A node between two sections, A above B, with S = c_A + c_B + r_A2 + r_B1 gives

        c = c_A c_B / S,
        r_1 = r_A1 + c_A (r_A2 + r_B1) / S,    r_2 = r_B2 + c_B (r_A2 + r_B1) / S.

    The `springs` are c, r_1 and r_2 of each section, from the top; the `motions` those of both
    ends.
    """
    motions = []
    negative = 0
    while springs.shape[1] > 1:
        paired = springs.shape[1] // 2 * 2
        (c_a, r_a1, r_a2), (c_b, r_b1, r_b2) = (springs[:, n:paired:2] for n in (0, 1))
        terms = np.array([c_a, c_b, r_a2, r_b1])
        own = terms.sum(0)
        # just beside a resonance of the node
        own = np.where(own == 0, EPS * np.abs(terms).sum(0), own)
        if not np.iscomplexobj(own):
            negative = negative + (own < 0).sum(0)
        one = c_a / own
        other = c_b / own
        ground = (r_a2 + r_b1) / own
        pairs = np.array([c_a * other, r_a1 + c_a * ground, r_b2 + c_b * ground])
        springs = np.concatenate([pairs, springs[:, paired:]], axis=1)
        still = np.zeros_like(one)
        full = np.ones_like(one)
        motions.append(
            (np.array([[full, still], [one, other]]), np.array([[one, other], [still, full]]))
        )
    return Joined(springs[:, 0], motions, negative)


def section_motions(
    motions: list[tuple[Inexact[np.ndarray, "end end _ *#shape"], ...]],
    motion: Inexact[np.ndarray, "end motion *shape"],
) -> Inexact[np.ndarray, "section end motion *shape"]:
    """Motion of every section, from r motions of the whole, in the coordinates that joined them."""
    parts = motion[None]
    for upper, lower in reversed(motions):
        joined = parts[: upper.shape[2]]
        both = [np.einsum("ijp...,pjr...->pir...", form, joined) for form in (upper, lower)]
        both = np.stack(both, axis=1)
        parts = np.concatenate([both.reshape(-1, *both.shape[2:]), parts[upper.shape[2] :]])
    return parts
