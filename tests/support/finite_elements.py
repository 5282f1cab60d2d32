"""Whole suspensions in finite elements, for tests: wires that bend, stretch, twist and have mass,
cut into small pieces.

Every wire is a chain of elements about the nominal pose, which has to balance: Hermite cubics
across it in both principal planes (bending, tension, consistent mass; Przemieniecki, Theory of
Matrix Structural Analysis, sections 11 and 15), quadratic ones for stretching and twisting. Its end
nodes move with the bodies and blade tips that it is clamped to. Shares no code with the mechanics
of wires.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from suspension_cli.equilibrium import energy
from suspension_cli.scene.fibres import compose
from suspension_cli.scene.pose import layout, nominal_pose

LAYER = 2.0
"""Decay lengths sqrt(EI/T) over which the mesh is fine at the ends of a section."""


@dataclass(frozen=True)
class Chain:
    """A wire cut into elements: K and M of its parts over their nodes, from the upper to the lower
    end.

    Attributes
    ----------
    bending : tuple of two (K, M)
        w, w' of each node in each plane.
    stretching, twisting : (K, M)
        u or the angle at each node and in the middle between nodes.
    """

    bending: tuple
    stretching: tuple
    twisting: tuple


def cross(vector):
    x, y, z = vector
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def mesh(length, wave, count):
    """Lengths of elements, finer where a wire of decay length 1/wave bends."""
    if count < 4 or wave * length < 16:
        return np.full(count, length / count)
    x = np.concatenate([[0.0], np.geomspace(1e-3 / wave, length / 2, 4000)])
    x = np.concatenate([x, length - x[-2::-1]])
    density = (
        x / length
        + 0.6 * (1 - np.exp(-x * wave / LAYER))
        - 0.6 * (1 - np.exp(-(length - x) * wave / LAYER))
    )
    return np.diff(np.interp(np.linspace(density[0], density[-1], count + 1), density, x))


def bent_element(rigidity, tension, mass, size):
    h = size
    bending = np.array(
        [
            [12, 6 * h, -12, 6 * h],
            [6 * h, 4 * h**2, -6 * h, 2 * h**2],
            [-12, -6 * h, 12, -6 * h],
            [6 * h, 2 * h**2, -6 * h, 4 * h**2],
        ]
    )
    pulled = np.array(
        [
            [36, 3 * h, -36, 3 * h],
            [3 * h, 4 * h**2, -3 * h, -(h**2)],
            [-36, -3 * h, 36, -3 * h],
            [3 * h, -(h**2), -3 * h, 4 * h**2],
        ]
    )
    inertia = np.array(
        [
            [156, 22 * h, 54, -13 * h],
            [22 * h, 4 * h**2, 13 * h, -3 * h**2],
            [54, 13 * h, 156, -22 * h],
            [-13 * h, -3 * h**2, -22 * h, 4 * h**2],
        ]
    )
    return rigidity / h**3 * bending + tension / (30 * h) * pulled, mass * h / 420 * inertia


def strained_element(rigidity, mass, size):
    stiffness = np.array([[7, -8, 1], [-8, 16, -8], [1, -8, 7]]) * rigidity / (3 * size)
    return stiffness, np.array([[4, 2, -1], [2, 16, 2], [-1, 2, 4]]) * mass * size / 30


def joined(elements, shared):
    """One matrix pair of a chain of elements whose neighbours share so many coordinates."""
    width = len(elements[0][0]) - shared
    result = np.zeros((2, width * len(elements) + shared, width * len(elements) + shared))
    for n, pair in enumerate(elements):
        part = slice(width * n, width * n + width + shared)
        result[:, part, part] += pair
    return result[0], result[1]


def twisting(section, tension):
    """GJ, and T I_p/A of a round section or of a ribbon."""
    a, b = section.shape.depth
    return section.twisting + tension * (a**2 / 8 if section.round else (a**2 + b**2) / 12)


def chain(sections, tension, counts):
    """A wire of `counts` elements in each section, cut for each of its parts."""

    def cut(element, shared, stiff, heavy, wave):
        sizes = [
            (one, h)
            for one, n in zip(sections, counts, strict=True)
            for h in mesh(one.length, wave(one), n)
        ]
        return joined([element(stiff(one), heavy(one), h) for one, h in sizes], shared)

    def plane(p):
        return cut(
            lambda ei, mu, h: bent_element(ei, tension, mu, h),
            2,
            lambda s: s.rigidity[p],
            lambda s: s.mass,
            lambda s: np.sqrt(tension / s.rigidity[p]),
        )

    return Chain(
        bending=(plane(0), plane(1)),
        stretching=cut(
            strained_element, 1, lambda s: s.stretching, lambda s: s.mass, lambda s: 0.0
        ),
        twisting=cut(
            strained_element, 1, lambda s: twisting(s, tension), lambda s: s.polar, lambda s: 0.0
        ),
    )


def end_forms(scene, number):
    """How an end moves with the coordinates: for the upper and the lower one w1, w1', w2, w2', u
    and twist (6, N)."""
    wires, fibre, numbering = scene.wires, scene.fibres.wire[number], layout(scene)
    along = wires.span[number] / wires.length[number]
    assert all(np.abs(clamp - along).max() < 1e-12 for clamp in fibre.clamp)
    first = fibre.plane - fibre.plane @ along * along
    first /= np.linalg.norm(first)
    second = np.cross(along, first)
    result = []
    for body, arm, blade in (
        (wires.upper[number], wires.upper_point[number], wires.blade[number]),
        (wires.lower[number], wires.lower_point[number], -1),
    ):
        move, turn = np.zeros((3, numbering.size + 1)), np.zeros((3, numbering.size + 1))
        move[:, 6 * body : 6 * body + 6] = np.hstack([np.eye(3), -cross(arm)])
        turn[:, 6 * body + 3 : 6 * body + 6] = np.eye(3)
        if blade >= 0:
            move[:, numbering.blade[blade]] = np.eye(3)
        # a turn t takes the direction of the wire to along + t x along
        rows = [
            first @ move,
            second @ turn,
            second @ move,
            -first @ turn,
            along @ move,
            along @ turn,
        ]
        result.append(np.array(rows)[:, :-1])
    return result


def rigid(scene):
    """K and M (N, N) of all but the wires' own: bodies, blades, springs, and forces at arms that
    turn with their bodies."""
    wires, blades, numbering, bodies = (
        scene.wires,
        scene.blades,
        layout(scene),
        len(scene.bodies.name) + 1,
    )
    k, m = np.zeros((2, numbering.size + 1, numbering.size + 1))
    for n, (mass, inertia) in enumerate(
        zip(scene.bodies.mass, scene.bodies.inertia, strict=True), 1
    ):
        m[6 * n : 6 * n + 3, 6 * n : 6 * n + 3] = mass * np.eye(3)
        m[6 * n + 3 : 6 * n + 6, 6 * n + 3 : 6 * n + 6] = inertia
    loads = [
        (wires.lower[w], wires.lower_point[w], wires.tension[w] * u, -1)
        for w, u in enumerate(wires.span / wires.length[:, None])
    ]
    loads += [
        (wires.upper[w], wires.upper_point[w], -wires.tension[w] * u, wires.blade[w])
        for w, u in enumerate(wires.span / wires.length[:, None])
    ]
    for b, mass in enumerate(blades.tip_mass):
        tip, body = numbering.blade[b], blades.body[b]
        loads.append((body, blades.tip[b], np.array([0, 0, mass * scene.gravity]), b))
        move = np.zeros((3, numbering.size + 1))
        move[:, 6 * body : 6 * body + 6] = np.hstack([np.eye(3), -cross(blades.tip[b])])
        move[:, tip] = np.eye(3)
        m += mass * move.T @ move
        k[tip, tip] += blades.stiffness[b]
    for body, arm, force, blade in loads:  # force: gradient of the energy with the point's position
        turn = slice(6 * body + 3, 6 * body + 6)
        k[turn, turn] += (np.outer(force, arm) + np.outer(arm, force)) / 2 - force @ arm * np.eye(3)
        if blade >= 0:
            tip = numbering.blade[blade]
            k[turn, tip] -= cross(force)
            k[tip, turn] -= cross(force).T
    if scene.springs.label:
        without = {
            part: replace(value, **{key: item[:0] for key, item in vars(value).items()})
            for part, value in (("wires", wires), ("blades", blades))
        }
        alone = replace(scene, gravity=0.0, flex=None, **without)
        k[: 6 * bodies, : 6 * bodies] += energy.gradient_and_stiffness(
            alone, layout(alone), nominal_pose(alone)
        )[1]
    return k[:-1, :-1], m[:-1, :-1]


def matrices(scene, elements=20):
    """K and M about the nominal pose: the scene's own coordinates (support first), then the inner
    nodes of every wire.

    Sections take `elements` of a wire by their lengths, four at least where there are several.
    """
    k, m = rigid(scene)
    for number, fibre in enumerate(scene.fibres.wire):
        lengths = np.array([section.length for section in fibre.sections])
        counts = np.maximum(
            1 if len(lengths) == 1 else 4, np.rint(elements * lengths / lengths.sum())
        ).astype(int)
        cut, (upper, lower) = (
            chain(fibre.sections, scene.wires.tension[number], counts),
            end_forms(scene, number),
        )
        parts = (
            (cut.bending[0], [0, 1]),
            (cut.bending[1], [2, 3]),
            (cut.stretching, [4]),
            (cut.twisting, [5]),
        )
        for (stiffness, mass), rows in parts:
            p, inner, size = len(rows), len(stiffness) - 2 * len(rows), len(k)
            form = np.zeros((len(stiffness), size + inner))
            form[:p, : upper.shape[1]], form[-p:, : lower.shape[1]] = upper[rows], lower[rows]
            form[p : p + inner, size:] = np.eye(inner)
            k, m = _grown(k, form, stiffness, p), _grown(m, form, mass, p)
    return k, m


def _grown(matrix, form, added, p):
    """A matrix with the inner nodes of one more part; only the ends' rows of `form` are full."""
    size, inner, ends = len(matrix), len(added) - 2 * p, np.r_[:p, len(added) - p : len(added)]
    result = np.zeros((size + inner, size + inner))
    result[:size, :size] = matrix
    to = form[ends, :size]
    columns = np.flatnonzero(np.abs(to).any(0))
    to = to[:, columns]
    result[np.ix_(columns, columns)] += to.T @ added[np.ix_(ends, ends)] @ to
    result[size:, size:] = added[p : p + inner, p : p + inner]
    result[size:, columns] = added[p : p + inner][:, ends] @ to
    result[columns, size:] = result[size:, columns].T
    return result


def with_fibres(scene, design):
    """The scene of a design, with what its wires are made of."""
    return replace(scene, fibres=compose(design))


def frequencies(scene, elements=20):
    """All frequencies (Hz), ascending, with the support held.

    With 20 elements the modes of bodies are within 1e-4 of the truth, those below `limit` within
    2e-3.

    1/omega^2 are eigenvalues, so that slow modes keep their digits; K must be positive definite.
    """
    k, m = (matrix[6:, 6:] for matrix in matrices(scene, elements))
    scale = 1 / np.sqrt(np.diag(k))
    root = np.linalg.cholesky(k * np.outer(scale, scale))
    half = scipy.linalg.solve_triangular(root, m * np.outer(scale, scale), lower=True)
    square = scipy.linalg.eigvalsh(scipy.linalg.solve_triangular(root, half.T, lower=True))[::-1]
    return 1 / (2 * np.pi * np.sqrt(square[square > 1e-16 * square[0]]))


def limit(scene, elements=20):
    """Frequency (Hz) above which some wire has a half wave on fewer than six elements."""
    wires = zip(scene.fibres.wire, scene.wires.tension, scene.wires.length, strict=True)
    return (
        elements
        / 6
        * min(
            np.sqrt(tension / max(one.mass for one in fibre.sections)) / (2 * length)
            for fibre, tension, length in wires
        )
    )


def between(found, gap=5e-3):
    """Frequencies in the middle of wide enough gaps between those found, and how many lie below:
    finite elements are not that wrong."""
    found = np.concatenate([[found[0] / 2], found])
    wide = np.flatnonzero(found[1:] > found[:-1] * (1 + gap))
    return np.sqrt(found[wide] * found[wide + 1]), wide
