"""A batch of balanced designs, of which quantities read what they need.

Each thing is computed once, when it is first read: modes for the whole batch, responses at the
frequencies of all quantities in one solve. What has no batch form (noise, damped modes, margins)
is computed design by design.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.equilibrium.solve import Equilibrium
from suspension_cli.errors import InputError
from suspension_cli.linear import batch_modes, mode_content, mode_pairing
from suspension_cli.linear.batch_modes import Spectrum
from suspension_cli.linear.eigenmodes import find_top_masses
from suspension_cli.linear.energy_of_modes import EnergyOfModes
from suspension_cli.linear.signals import Signal, linear_form
from suspension_cli.linear.solver import Solver
from suspension_cli.models import registry
from suspension_cli.models.choice import shifts
from suspension_cli.models.surroundings import nominal_positions, surrounded
from suspension_cli.physics import (
    closed_loop,
    closed_loop_margins,
    local_control,
    loops_of_builds,
    modes_with_loops,
    wire_modes,
)
from suspension_cli.physics.thermal_noise import compute_densities
from suspension_cli.quantities.needs import Needs
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.scene import Scene, select_scenes
from suspension_cli.studies import builds, variants
from suspension_cli.studies.builds import Builds
from suspension_cli.studies.job import nominal_system

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Inexact, Int

    from suspension_cli.linear.statespace import Poles
    from suspension_cli.linear.system import LinearSystem
    from suspension_cli.physics.local_control import Plant
    from suspension_cli.physics.loops_of_builds import ClosedBuilds
    from suspension_cli.physics.modes_with_loops import DampedModes

Part = tuple["Int[np.ndarray, ' place']", "Solved"]
"""Places in a batch, and the designs there, solved together."""


class Solved:
    """Balanced designs of one topology in one model, along the first axis of all arrays.

    Attributes
    ----------
    designs
        Of each place; random builds share their nominal design.
    found
        Their linear models and status.
    level
        Name of the model.
    needs
        What the quantities of the run need.
    exact_modes
        Whether frequencies of modes include what the mass of wires changes, by a search in each
        design; else they are those of wires without mass.
    """

    def __init__(
        self,
        designs: Sequence[Design],
        found: Builds,
        level: str,
        needs: Needs,
        balance_again: Callable[[str], Iterator[Part]],
        *,
        exact_modes: bool = False,
    ) -> None:
        self.designs = designs
        self.found = found
        self.level = level
        self.needs = needs
        self.exact_modes = exact_modes
        self._balance_again = balance_again
        self._in_other_models: dict[str, list[Part]] = {}
        self._solvers: dict[int, Solver] = {}
        self._shifts: dict[tuple[str, int], Array] = {}
        self._followed: dict[str, Array] = {}
        self._closed_loops: dict[int, tuple[Plant, Poles]] = {}

    @classmethod
    def of_systems(cls, model: LinearSystem, design: Design, level: str) -> Solved:
        """Stable systems of a batch, without equilibria: only modes are read from them."""
        (count,) = model.batch
        status = np.full(count, builds.GOOD, dtype=np.uint8)
        wire = np.full(count, -1, dtype=np.int16)
        found = Builds(model, status, wire, np.full(count, np.nan), (False, False))
        return cls([design] * count, found, level, Needs(), lambda _: iter(()))

    def with_loops(self, designs: Sequence[Design]) -> Solved:
        """Take other loops of local control on the same mechanics, which are solved once."""
        made = Solved(
            designs,
            self.found,
            self.level,
            self.needs,
            self._balance_again,
            exact_modes=self.exact_modes,
        )
        made._solvers = self._solvers
        return made

    @property
    def count(self) -> int:
        """Number of designs."""
        return len(self.designs)

    @property
    def has_wire_mass(self) -> bool:
        """Whether wires have mass in this model."""
        return registry.by_name(self.level).has_wire_mass

    @property
    def is_steady(self) -> Bool[np.ndarray, " design"]:
        """Which designs have a steady state: a stable equilibrium, or one that is allowed."""
        return self.found.status == builds.GOOD

    @property
    def hangs(self) -> Bool[np.ndarray, " design"]:
        """Which designs have an equilibrium on taut wires, stable or not."""
        return self.is_steady | (self.found.status == builds.UNSTABLE)

    @cached_property
    def spectrum(self) -> Spectrum:
        """Undamped modes, ascending, of wires without mass; NaN where a design does not hang."""
        hung = np.flatnonzero(self.hangs)
        with np.errstate(all="ignore"):
            if len(hung) == self.count:
                return batch_modes.solve(self.found.model.constant)
            found = batch_modes.solve(self.found.model.constant.select(hung))
        return Spectrum(*(_put(own, hung, self.count) for own in vars(found).values()))

    @cached_property
    def _exact(
        self,
    ) -> tuple[Float[np.ndarray, "design mode"], Float[np.ndarray, "design mode place"]] | None:
        """`omega_squared` and `fractions` with the mass of wires, if that is asked for."""
        if not (self.exact_modes and self.has_wire_mass):
            return None
        squared = np.full_like(self.spectrum.omega_squared, np.nan)
        fractions = np.full_like(self._plain_fractions, np.nan)
        for n in np.flatnonzero(self.hangs).tolist():
            with contextlib.suppress(InputError):
                modes = wire_modes.solve_undamped_bodies(self.solver(n).system)
                if len(modes.omega_squared) == squared.shape[1]:
                    squared[n] = modes.omega_squared
                    fractions[n] = modes.fractions[:, : fractions.shape[-1]]
        return squared, fractions

    @property
    def omega_squared(self) -> Float[np.ndarray, "design mode"]:
        """omega^2 of the undamped modes, (rad/s)^2, ascending; negative for those that grow."""
        return self.spectrum.omega_squared if self._exact is None else self._exact[0]

    @property
    def fractions(self) -> Float[np.ndarray, "design mode place"]:
        """Fractions of the kinetic energy of each mode in each motion."""
        return self._plain_fractions if self._exact is None else self._exact[1]

    @cached_property
    def _plain_fractions(self) -> Float[np.ndarray, "design mode place"]:
        """Those of the modes of wires without mass."""
        with np.errstate(all="ignore"):
            return mode_content.of_spectrum(self.found.model, self.spectrum)

    @cached_property
    def energy_of_modes(self) -> EnergyOfModes:
        """Kinetic energy of the undamped modes, by which their names find them."""
        return EnergyOfModes(self.fractions, len(self.found.model.body))

    @property
    def energy(self) -> Float[np.ndarray, "design mode body 6"]:
        """Fractions of the kinetic energy of each mode in each degree of freedom of each body."""
        return self.energy_of_modes.of_bodies

    @cached_property
    def top_fraction(self) -> Float[np.ndarray, "design mode"]:
        """Fraction of the kinetic energy of each mode in the top mass of its chain."""
        energy = self.energy
        if self._exact is None:
            # small fractions have smaller rounding errors from the shapes of unit length
            shape = self.spectrum.shape[..., : 6 * energy.shape[2]]
            energy = (shape**2).reshape(energy.shape)
        flat = energy.reshape(-1, *energy.shape[2:])
        top = find_top_masses(np.nan_to_num(flat), self.found.model.top)
        return flat[np.arange(len(flat)), top].sum(-1).reshape(energy.shape[:2])

    @cached_property
    def frequency(self) -> Float[np.ndarray, "design mode"]:
        """Frequencies of the undamped modes, Hz; NaN of those that grow."""
        squared = self.omega_squared
        return np.sqrt(np.where(squared >= 0, squared, np.nan)) / (2 * np.pi)

    @cached_property
    def frequency_or_growth(self) -> Float[np.ndarray, "design mode"]:
        """Frequencies of the undamped modes, Hz; minus the growth rate over 2 pi of others."""
        squared = self.omega_squared
        return np.sign(squared) * np.sqrt(np.abs(squared)) / (2 * np.pi)

    def followed(self, nominal: str) -> Int[np.ndarray, "design mode"]:
        """Numbers of the modes that those of a nominal design (TOML) have become, by their shapes.

        In the order of that design's modes in the same model; -1 in designs of other coordinates.
        """
        if nominal not in self._followed:
            before = batch_modes.solve(nominal_system(nominal, self.level)).shape
            after = self.spectrum.shape
            numbers = np.full((self.count, len(before)), -1)
            if before.shape == after.shape[1:]:
                with np.errstate(all="ignore"):
                    numbers = mode_pairing.pair_batch(before, after)
            self._followed[nominal] = numbers
        return self._followed[nominal]

    def response(
        self, into: Signal, out: Signal, frequency: float
    ) -> Complex[np.ndarray, " design"]:
        """Response of a motion to an input at a frequency in Hz that is among the `needs`."""
        place = (
            slice(None),
            self.needs.frequency.index(frequency),
            self.needs.outputs.index(out),
            self.needs.inputs.index(into),
        )
        return self._responses[place]

    @cached_property
    def _responses(self) -> Complex[np.ndarray, "design frequency output input"]:
        needs = self.needs
        return self.responses(np.array(needs.frequency), needs.inputs, needs.outputs)

    def responses(
        self, frequency: Array, inputs: Sequence[Signal], outputs: Sequence[Signal]
    ) -> Complex[np.ndarray, "design frequency output input"]:
        """Responses of motions to inputs at frequencies in Hz."""
        with np.errstate(all="ignore"):  # of designs that failed
            return builds.transfer(self.found, frequency, list(inputs), list(outputs))

    def solver(self, number: int) -> Solver:
        """Solver of the linear system of one design, without batch axes.

        Raises `InputError` if it does not balance.
        """
        if number not in self._solvers:
            design = self.designs[number]
            model = registry.by_name(self.level)
            if self.found.scene is None:
                made = model.system(design)
            else:
                scene = select_scenes(self.found.scene, number)
                bare = registry.scene_model(self.level).of_scene(scene, design)
                made = surrounded(bare, design, nominal_positions(design))
            self._solvers[number] = Solver(made)
        return self._solvers[number]

    def closed_loops(self, number: int) -> tuple[Plant, Poles]:
        """Loops of one design on its linear system, and its closed-loop poles.

        Raises `InputError` if it does not balance, or if a pole is lost.
        """
        if number not in self._closed_loops:
            plant = local_control.build_plant(self.designs[number], self.solver(number))
            self._closed_loops[number] = plant, closed_loop.find_poles(plant)
        return self._closed_loops[number]

    def shifts_from(self, old: Solved, number: int) -> Float[np.ndarray, " mode"]:
        """Relative changes of the modes of one design from another model to this one.

        In the order of its modes here; see `models.choice.shifts`.
        """
        key = old.level, number
        if key not in self._shifts:
            self._shifts[key] = shifts(old.solver(number), self.solver(number))[1]
        return self._shifts[key]

    def each(
        self, compute: Callable[[Solver, Design], object], *shape: int
    ) -> Float[np.ndarray, "design ..."]:
        """Compute something of each design that hangs; NaN of others, and of failures."""
        result = np.full((self.count, *shape), np.nan)
        for n in np.flatnonzero(self.hangs).tolist():
            try:
                result[n] = compute(self.solver(n), self.designs[n])
            except InputError:  # a resonance without loss, a search that found nothing
                continue
        return result

    def thermal(self, motion: Signal, frequency: float) -> Float[np.ndarray, " design"]:
        """Thermal noise of a motion at a frequency in Hz, both among the `needs`, unit/sqrt(Hz)."""
        needs = self.needs
        place = needs.warm_motions.index(motion), needs.warm_frequency.index(frequency)
        return self._thermal[(slice(None), *place)]

    @cached_property
    def _thermal(self) -> Float[np.ndarray, "design motion frequency"]:
        motions = self.needs.warm_motions
        frequency = np.array(self.needs.warm_frequency)

        def compute(solver: Solver, design: Design) -> Array:
            rows = np.array([linear_form(signal, solver.system) for signal in motions])
            temperature = design.constants.temperature
            powers = compute_densities(solver, frequency, rows, temperature)
            none = np.zeros(len(frequency))
            total = np.array([sum(one.values(), none) for one in powers])
            return np.sqrt(np.where(np.isfinite(total), total, np.nan))

        return self.each(compute, len(motions), len(frequency))

    @cached_property
    def _closed_builds(self) -> list[ClosedBuilds]:
        """Builds of one design with its loops closed, by number among the designs that hang."""
        hung = np.flatnonzero(self.hangs)
        same = len({id(design) for design in self.designs}) == 1
        if not len(hung) or not same or self.found.scene is None:
            return []
        with np.errstate(all="ignore"):
            return loops_of_builds.close_builds(self.found.model.select(hung), self.designs[0])

    @cached_property
    def damped_modes(self) -> list[DampedModes | None]:
        """Modes of each design with all losses, dampers and loops; None of those that fail."""
        found: list[DampedModes | None] = [None] * self.count
        hung = np.flatnonzero(self.hangs).tolist()
        for part in self._closed_builds:
            for number, modes in part.modes().items():
                found[hung[number]] = modes
        for n in hung:
            if found[n] is None:
                with contextlib.suppress(InputError):
                    found[n] = modes_with_loops.solve_modes(self.solver(n), self.designs[n])
        return found

    @property
    def is_stable_closed(self) -> Float[np.ndarray, " design"]:
        """Whether each design is stable with its loops closed: 1 or 0; NaN of those that fail."""
        return self._stable_and_margins[0]

    @property
    def margins(self) -> Float[np.ndarray, "design loop margin"]:
        """Margins of each loop (`closed_loop_margins.MARGINS`); NaN if its closed loop grows."""
        return self._stable_and_margins[1]

    @cached_property
    def _stable_and_margins(
        self,
    ) -> tuple[Float[np.ndarray, " design"], Float[np.ndarray, "design loop margin"]]:
        """See `is_stable_closed` and `margins`."""
        control = self.designs[0].control
        loops = 0 if control is None else len(control.loop)
        stable = np.full(self.count, np.nan)
        margins = np.full((self.count, loops, len(closed_loop_margins.MARGINS)), np.nan)
        hung = np.flatnonzero(self.hangs)
        for part in self._closed_builds:
            known = np.flatnonzero(part.poles.known & ~part.poles.stable)
            stable[hung[part.number[known]]] = 0.0
            number, values = part.margins()
            stable[hung[number]] = 1.0
            margins[hung[number]] = values
        for n in hung[np.isnan(stable[hung])].tolist():
            with contextlib.suppress(InputError):  # a search that found nothing
                design = self.designs[n]
                stable[n], margins[n] = closed_loop_margins.compute_margins(self.solver(n), design)
        return stable, margins

    @property
    def equilibrium(self) -> Equilibrium:
        """Poses and tensions."""
        assert self.found.equilibrium is not None
        return self.found.equilibrium

    @property
    def scene(self) -> Scene:
        """The designs as arrays."""
        assert self.found.scene is not None
        return self.found.scene

    def in_model(
        self, level: str, read: Callable[[Solved], Inexact[np.ndarray, " design"]]
    ) -> Inexact[np.ndarray, " design"]:
        """Read something of these designs in another model; NaN where one has no equilibrium."""
        if level == self.level:
            return read(self)
        if level not in self._in_other_models:
            self._in_other_models[level] = list(self._balance_again(level))
        result: Array | None = None
        for places, part in self._in_other_models[level]:
            found = read(part)
            if result is None:
                result = np.full((self.count, *found.shape[1:]), np.nan, found.dtype)
            result[places] = found
        return np.full(self.count, np.nan) if result is None else result

    def with_bending(
        self, read: Callable[[Solved], Inexact[np.ndarray, " design"]]
    ) -> Inexact[np.ndarray, " design"]:
        """Read something where wires bend: losses act where they do."""
        bends = registry.by_name(self.level).bends_wires
        return self.in_model(self.level if bends else registry.BEAM.name, read)

    def on_strings(
        self, read: Callable[[Solved], Inexact[np.ndarray, " design"]]
    ) -> Inexact[np.ndarray, " design"]:
        """Read something of the equilibrium: of models without one, that of strings."""
        known = registry.by_name(self.level).supports_builds
        return self.in_model(self.level if known else registry.STRING.name, read)


def _put(values: Array, places: Int[np.ndarray, " place"], count: int) -> Array:
    """Put values of some designs at their places among all; NaN, or of integers 0, elsewhere."""
    empty = np.nan if values.dtype.kind == "f" else 0
    result = np.full((count, *values.shape[1:]), empty, values.dtype)
    result[places] = values
    return result


def of_designs(
    designs: Iterable[Design | None],
    level: str,
    needs: Needs,
    *,
    allow_unstable: bool = False,
    exact_modes: bool = False,
) -> Iterator[Part]:
    """Balance designs in a model, in batches of one topology, with their places.

    Designs that are None, or that the model cannot describe, are in no batch. `exact_modes` is as
    in `Solved`.
    """
    how = {"allow_unstable": allow_unstable, "exact_modes": exact_modes}
    known = list(designs)
    for found, places in variants.balanced(known, level, allow_unstable=allow_unstable):
        own = [design for n in places.tolist() if (design := known[n]) is not None]

        def again(other: str, own: list[Design] = own) -> Iterator[Part]:
            return of_designs(own, other, needs, **how)

        yield places, Solved(own, found, level, needs, again, exact_modes=exact_modes)


def of_builds(
    scene: Scene, design: Design, level: str, needs: Needs, *, allow_unstable: bool = False
) -> Solved:
    """Balance a batch of builds of one design, given as a scene with one batch axis."""
    found = builds.balance(scene, design, level=level, allow_unstable=allow_unstable)
    count = len(found.status)

    def again(other: str) -> Iterator[Part]:
        yield (
            np.arange(count),
            of_builds(scene, design, other, needs, allow_unstable=allow_unstable),
        )

    return Solved([design] * count, found, level, needs, again)
