"""Wires sampled at few frequencies against the same wires solved at each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.design.materials import Bulk
from suspension_cli.design.schema import Gas
from suspension_cli.design.wires import WireDamper
from suspension_cli.elements import sampled_wire
from suspension_cli.elements.dynamic_wire import PARTS, PartAtFrequencies
from suspension_cli.elements.sampled_wire import SampledWire
from tests.elements.test_joined_sections import STEPPED, silica, strand

FREQUENCY = np.concatenate([[0.0], np.geomspace(0.1, 3000, 3000)])
OMEGA = 2 * np.pi * FREQUENCY
RNG = np.random.default_rng(5)


def with_sections(wire, **changes):
    sections = tuple(replace(section, **changes) for section in wire.fibre.sections)
    return replace(wire, fibre=replace(wire.fibre, sections=sections))


def with_damper(wire):
    """A damper with a resonance of its own below the first section."""
    first, *others = wire.fibre.sections
    damped = replace(first, damper=WireDamper(mass=1e-4, stiffness=20.0, loss_angle=0.3))
    return replace(wire, fibre=replace(wire.fibre, sections=(damped, *others)))


def warmer(wire):
    """A wire with a temperature of its own in each section."""
    sections = tuple(
        replace(section, temperature=290.0 + n) for n, section in enumerate(wire.fibre.sections)
    )
    return replace(wire, fibre=replace(wire.fibre, sections=sections))


TAPERS = silica(STEPPED["tapers"])
AIR = Gas(pressure=1.0, molar_mass=0.028, temperature=300.0)
STEPS = Bulk(0.0, ((1.0, 30.0, 31.0, 1000.0), (1e-6, 1e-4, 1e-6, 1e-5)))
THIN = [(1e-3, 0.05), (1e-3, 0.05), (2e-5, 0.1), (2e-5, 0.1), (1e-3, 0.05), (1e-3, 0.05)]
WIRES = {
    "lossless": strand(TAPERS),
    "lossy": strand(TAPERS, angle=1e-3),
    "hardly lossy": strand(TAPERS, angle=1e-12),
    "in gas": strand(TAPERS, angle=1e-6, surrounded=AIR),
    "in gas alone": strand(TAPERS, angle=1e-15, surrounded=AIR),
    "resonant between thick ends": strand(silica(THIN), angle=1e-6),
    "damped": with_damper(strand(TAPERS, angle=1e-6)),
    "warmer below": warmer(strand(TAPERS, angle=1e-4)),
    "angles from a table": with_sections(strand(TAPERS, angle=1e-4), losses=(STEPS,)),
}


@pytest.fixture(params=WIRES)
def wire(request):
    return WIRES[request.param]


@pytest.mark.parametrize("part", PARTS)
def test_stiffness_is_that_of_each_frequency(wire, part):
    """Within 1e-13 of the elements on the diagonal; imaginary parts within 1e-9 of themselves."""
    found = SampledWire(wire, OMEGA)[part].stiffness
    exact = wire.at(OMEGA)[part].stiffness
    diagonal = np.einsum("iif->if", exact)
    still = diagonal[:, :1]
    size = np.abs(still) + np.abs(diagonal - still)  # where both cancel, too
    own = np.sqrt(size)
    assert (np.abs(found - exact) <= 1e-13 * own[:, None] * own).all()
    lost, exactly = (np.imag(each) for each in (np.einsum("iif->if", found), diagonal))
    assert (np.abs(lost - exactly) <= 1e-9 * np.abs(exactly) + 1e-15 * size).all()


@pytest.mark.parametrize("part", PARTS)
def test_dissipation_is_that_of_each_frequency(wire, part):
    """Within 1e-9 of the sum over causes; with gas, its share is known to first order in losses."""
    count = len(wire.at(OMEGA[1:2])[part].stiffness)
    motion = RNG.normal(size=(count, 3, len(OMEGA))) + 1j * RNG.normal(size=(count, 3, len(OMEGA)))
    found = SampledWire(wire, OMEGA)[part].dissipated(motion)
    exact = wire.at(OMEGA)[part].dissipated(motion)
    assert found.keys() == exact.keys()
    total = sum(exact.values())
    stored = np.einsum("imf,ijf,jmf->mf", motion.conj(), wire.at(OMEGA)[part].stiffness, motion)
    limit = 1e-9 * total + 1e-14 * np.abs(stored)
    assert (np.abs(sum(found.values()) - total) <= limit).all()
    for cause, value in exact.items():
        assert (np.abs(found[cause] - value) <= limit).all()


@pytest.mark.parametrize("part", ["bend-1", "stretch"])
def test_no_piece_with_a_resonance_is_sampled(part):
    """Resonances with clamped ends, by bisection: in none of the pieces that are taken."""
    wire = WIRES["resonant between thick ends"]
    omega = 2 * np.pi * np.geomspace(1, 30000, 20000)
    sampled = SampledWire(wire, omega)
    resonances = wire.held_resonances(part, omega[-1])

    def contain_one(pieces):
        return [((piece.low <= resonances) & (resonances <= piece.high)).any() for piece in pieces]

    assert any(contain_one(sampled.pieces))
    taken = sampled.make(PARTS.index(part)).pieces
    assert taken
    assert not any(contain_one(taken))


def test_few_frequencies_are_solved(monkeypatch):
    """Of 2,000 below the first resonance, those at nodes of nine pieces, beside them, and one."""
    solved = []

    def counted(part):
        solved.append(len(part.omega))
        return kept.__get__(part)

    kept = PartAtFrequencies.__dict__["_joined"]
    monkeypatch.setattr(PartAtFrequencies, "_joined", property(counted))
    omega = 2 * np.pi * np.geomspace(0.5, 90, 2000)
    found = SampledWire(WIRES["lossy"], omega)["bend-1"].stiffness
    assert found.shape == (4, 4, 2000)
    assert sorted(set(solved)) == [1, 2 * 9, 9 * sampled_wire.NODES]


def test_responses_and_noise_of_pulled_fibres(monkeypatch):
    """A design with 94 sections per fibre, sampled and not: alike within 1e-9."""
    design = sus.example("pulled-fibres")
    frequency = np.geomspace(1, 2000, 600)
    response = sus.response(design, frequency=frequency).value
    noise = sus.thermal(design, frequency=frequency)
    monkeypatch.setattr(sampled_wire, "MANY_SECTIONS", 1000)
    exactly = sus.thermal(design, frequency=frequency)
    np.testing.assert_allclose(response, sus.response(design, frequency=frequency).value, rtol=1e-9)
    np.testing.assert_allclose(noise.amplitude, exactly.amplitude, rtol=1e-9)
    assert noise.source == exactly.source
