"""Questions about a design, which each model answers with its own cost and error."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses import registry as analyses
from suspension_cli.analyses import settings
from suspension_cli.analyses.modes import wire_modes
from suspension_cli.analyses.sweep.solve import ParameterSweep
from suspension_cli.analyses.thermal import solve as thermal
from suspension_cli.analyses.xcouple.command import axes
from suspension_cli.analyses.xcouple.solve import ROUNDING, Sweep, parse_request
from suspension_cli.design.derive import mirror
from suspension_cli.design.reader import Source
from suspension_cli.errors import InputError
from suspension_cli.linear import response, signals
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.mode_pairing import body_overlap, pair_by_overlap
from suspension_cli.linear.named_results import Mode
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.models.base import Model
from suspension_cli.models.choice import away_from_modes, relative_change, spectrum_change
from suspension_cli.studies.job import Axis

if TYPE_CHECKING:
    from jaxtyping import Inexact

Spectrum = tuple[LinearSystem, np.ndarray]
"""A linear system, and its response or noise on the grid of a question."""
FREQUENCIES = 200
"""Number of frequencies of a response or noise."""
DESIGNS = 100
"""Number of designs of a sweep."""
SPREAD = 0.01
"""Relative range of the mirror's mass in a sweep, to either side."""


class Question(ABC):
    """What is asked about a design: a quantity of `command.QUANTITIES`, in words in `text`.

    `count` designs or builds are computed together; times are for one.
    """

    quantity: str
    text: str
    count: int = 1

    def __init__(self, source: Source) -> None:
        self.source, self.design = source, source.design
        self.mirror = mirror(source.design)

    @abstractmethod
    def solve(self, model: Model) -> Any:
        """Compute the result in one model. Raises `InputError` if that has none."""

    def work(self, model: Model) -> Callable[[], object]:
        """Return the function whose time counts. Raises `InputError` if there is none."""
        return partial(self.solve, model)

    @abstractmethod
    def compare(self, found: Any, true: Any) -> tuple[float, str]:
        """Compute the largest relative error of a result, and where it is."""


class ModeFrequencies(Question):
    """Frequencies of the bodies' modes, with all losses, as `pendsus modes` lists them."""

    quantity, text = "modes", "mode frequencies"

    def solve(self, model: Model) -> Modes:
        """Compute the modes of one design."""
        return wire_modes.solve_bodies(model.system(self.design))

    def compare(self, found: Modes, true: Modes) -> tuple[float, str]:
        """Compare frequencies; modes are paired by their shapes."""
        count = 6 * len(true.body)
        mass = registry.STRING.system(self.design).mass[6 : 6 + count, 6 : 6 + count]
        partner = pair_by_overlap(body_overlap(true.shape, found.shape, mass))
        here = np.flatnonzero((partner >= 0) & (true.frequency > 0))
        if not len(here):
            return 0.0, ""
        error = np.abs(found.frequency[partner[here]] / true.frequency[here] - 1)
        worst = int(np.argmax(error))
        return float(error[worst]), true.label[here[worst]]


class ModesInSweep(ModeFrequencies):
    """The same frequencies, for each of many designs as in `pendsus sweep`."""

    text, count = f"mode frequencies in a sweep, each of {DESIGNS} designs", DESIGNS

    def work(self, model: Model) -> Callable[[], object]:
        """Prepare a sweep of the mirror's mass."""
        if model.has_wire_mass:
            raise InputError.of("", "a sweep follows the modes of wires without mass", "")
        body = next(stage.body for stage in self.design.stage if stage.name == self.mirror)
        key = "density" if body.mass is None else "mass"
        values = getattr(body, key) * np.linspace(1 - SPREAD, 1 + SPREAD, DESIGNS)
        axis = Axis(f"stage.{self.mirror}.body.{key}", tuple(values.tolist()))
        job = ParameterSweep(self.source.text, (axis,), model.name, (Mode("every", 0),))
        job.check()
        return partial(job.compute, 0, DESIGNS)


class Response(Question):
    """Response of the mirror to the support along x over a range of frequencies."""

    quantity, text = "response", "response"

    def __init__(self, source: Source, low: float, high: float) -> None:
        super().__init__(source)
        self.text = f"{self.text} from {low:g} to {high:g} Hz, {FREQUENCIES} frequencies"
        self.frequency = np.geomspace(low, high, FREQUENCIES)

    def solve(self, model: Model) -> Spectrum:
        """Compute the response from the design on."""
        system = model.system(self.design)
        known = signals.bodies_with_signals(system)
        into = signals.parse_input("support.x", known)
        out = signals.parse_output(f"{self.mirror}.x", known)
        return system, response.solve(system, self.frequency, [into], [out]).value[:, 0, 0]

    def compare(self, found: Spectrum, true: Spectrum) -> tuple[float, str]:
        """Compare both at sampled frequencies away from the modes of bodies."""
        (one, values), (other, wanted) = found, true
        at = np.searchsorted(self.frequency, away_from_modes(self.frequency, one, other))
        change = spectrum_change(values[at], wanted[at])
        worst = int(np.argmax(change))
        return float(change[worst]), f"at {self.frequency[at[worst]]:.4g} Hz"


class ThermalNoise(Response):
    """Thermal noise of the mirror along x over a range of frequencies."""

    quantity, text = "thermal", "thermal noise"

    def solve(self, model: Model) -> Spectrum:
        """Compute the noise from the design on."""
        if not model.bends_wires:
            raise InputError.of("", "it does not know where along a wire its loss acts", "")
        system = model.system(self.design)
        motion = thermal.parse_motion(system, f"{self.mirror}.x")
        warmth = self.design.constants.temperature
        found = thermal.solve(system, self.frequency, [motion], warmth)[0].amplitude
        if not found.any():
            raise InputError.of("", "nothing dissipates", "")
        return system, found


class Coupling(Question):
    """Cross-coupling of imperfect builds: wire, signals and frequency of `pendsus xcouple`."""

    quantity = "coupling"

    def __init__(self, source: Source) -> None:
        super().__init__(source)
        analysis = analyses.get("xcouple")
        setting = settings.merge(analysis, source, {})
        asked = parse_request(registry.STRING.system(self.design), setting, self.mirror)
        asked = replace(asked, frequency=asked.frequency[:1])
        self.job = Sweep(source.text, axes("k,offset", {}), asked)
        self.count = self.job.count
        at = f"{asked.frequency[0]:.4g} Hz"
        self.text = f"cross-coupling at {at}, each of {self.count} imperfect builds"

    def solve(self, model: Model) -> Inexact[np.ndarray, "build 1"]:
        """Compute the coupling of all builds."""
        if not model.supports_builds:
            raise InputError.of("", "it has no imperfect builds", "")
        if self.job.question.wire < 0:
            raise InputError.of("", "the mirror hangs on no wire", "")
        found = replace(self.job, level=model.name).compute(0, self.count)["ratio"]
        if not np.isfinite(found).any():
            raise InputError.of("", "no imperfect build has a stable equilibrium on taut wires", "")
        if not np.nanmax(np.abs(found)) > ROUNDING:
            raise InputError.of("", "these imperfections couple nothing", "")
        return found

    def compare(self, found: np.ndarray, true: np.ndarray) -> tuple[float, str]:
        """Compute the largest error over the largest coupling; infinite if no build has both."""
        change = relative_change(found, true)
        return math.inf if math.isnan(change) else change, "of the largest"


def ask(source: Source) -> tuple[Question, ...]:
    """List all questions about a design."""
    return (
        ModeFrequencies(source),
        ModesInSweep(source),
        Response(source, 0.1, 10.0),
        Response(source, 50.0, 1000.0),
        ThermalNoise(source, 10.0, 100.0),
        Coupling(source),
    )
