"""Everything that is compared.  A method more is an entry more here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.analysis.tradeoff import eigen, imperfect, noise, spectra, transfer
from suspension_cli.analysis.tradeoff.result import View
from suspension_cli.analysis.tradeoff.subject import COUPLING, FREQUENCIES, NOISE, Subject

Once = Callable[[Subject], Any]
Batch = Callable[[Subject], Callable[[], object]]


def suits(_: Subject) -> str:
    """Nothing speaks against it."""
    return ""


@dataclass(frozen=True)
class Method:
    """One way to a quantity.

    Attributes
    ----------
    rung, name : str
    once : callable
        The quantity itself, from a subject.
    batch : callable or None
        From a subject, what computes a whole batch; None if a batch is done one by one.
    unsuited : callable
        Why it does not apply, beyond its rung; empty if it does.
    """

    rung: str
    name: str
    once: Once
    batch: Batch | None = None
    unsuited: Callable[[Subject], str] = suits


@dataclass(frozen=True)
class Quantity:
    """Something that a designer wants to know, and all the ways to it.

    Attributes
    ----------
    name, title, start, item : str
        As in `result.Panel`.
    count : int
        Items in a batch.
    against : str
        What the reference is; ``{top}`` stands for the top rung that holds.
    reference : callable
        The truth, from a subject.
    error : callable
        Errors by component, from subject, what a method gave and the truth.
    methods : tuple of Method
    views : dict
        Titles to names of components; none: all together under the quantity's title.
    unsuited : callable
        Why no method applies; empty if some do.
    """

    name: str
    title: str
    start: str
    item: str
    count: int
    against: str
    reference: Once
    error: Callable[[Subject, Any, Any], dict[str, float]]
    methods: tuple[Method, ...]
    views: dict[str, tuple[str, ...]]
    unsuited: Callable[[Subject], str] = suits

    def judged(self, components: tuple[str, ...]) -> tuple[View, ...]:
        """The views of the components found."""
        if not self.views:
            return (View(self.title, tuple(range(len(components)))),)
        return tuple(View(title, tuple(components.index(name) for name in names)) for title, names in self.views.items())


def hertz(frequency: float) -> str:
    """``50 Hz``, ``1 kHz``."""
    return f"{frequency / 1000:g} kHz" if frequency >= 1000 else f"{frequency:g} Hz"


def relative(frequencies: tuple[float, ...]) -> Callable[[Subject, Any, Any], dict[str, float]]:
    """|found - true| / |true| at each frequency."""

    def error(_: Subject, found: Any, wanted: Any) -> dict[str, float]:
        values = np.abs(found - wanted) / np.abs(wanted)
        return dict(zip(map(hertz, frequencies), values.tolist(), strict=True))

    return error


LOW, HIGH = (tuple(hertz(f) for f in FREQUENCIES if (f <= 50) == low) for low in (True, False))

FROM_DESIGN = "from the design to the result"
FROM_MATRICES = "from the matrices to the result"
EXACT_TOP = "the {top} rung, its matrices solved in 50 digits"
EXACT_STRING = "the string rung's own matrices in 50 digits"

QUANTITIES: dict[str, Quantity] = {
    quantity.name: quantity
    for quantity in (
        Quantity(
            name="modes",
            title="Mode frequencies, by rung",
            start=FROM_DESIGN,
            item="design",
            count=eigen.DESIGNS,
            against="the {top} rung; modes paired by shape",
            reference=eigen.reference,
            error=eigen.error,
            methods=(
                Method("closed-form", "formulas", eigen.formulas, eigen.formulas_batch),
                Method("closed-form", "blocks", lambda s: eigen.solved(s, "closed-form")),
                Method("force", "blocks", lambda s: eigen.solved(s, "force"), eigen.force_batch),
                Method("force", "dense", lambda s: eigen.solved_whole(s, "force")),
                Method("string", "blocks", lambda s: eigen.solved(s, "string")),
                Method("string", "dense", lambda s: eigen.solved_whole(s, "string"), eigen.string_batch),
                Method("beam", "blocks", lambda s: eigen.solved(s, "beam")),
                Method("beam", "dense", lambda s: eigen.solved_whole(s, "beam")),
                Method("violin", "counted", eigen.counted),
            ),
            views={},
        ),
        Quantity(
            name="modes-digits",
            title="Mode frequencies, arithmetic alone",
            start=FROM_MATRICES,
            item="design",
            count=eigen.DESIGNS,
            against=EXACT_STRING,
            reference=spectra.reference,
            error=spectra.error,
            methods=(
                Method("string", "blocks", spectra.by_block, spectra.by_block_batch),
                Method("string", "dense", spectra.whole, spectra.whole_batch),
                Method("string", "eig(M⁻¹K)", spectra.unsymmetric, spectra.unsymmetric_batch),
                Method("string", "state-space poles", spectra.poles),
                Method("string", "counted", spectra.bisected),
            ),
            views={},
        ),
        Quantity(
            name="response",
            title="Response, by rung",
            start=FROM_DESIGN,
            item="frequency",
            count=transfer.SWEEP,
            against=EXACT_TOP,
            reference=transfer.reference,
            error=relative(FREQUENCIES),
            methods=(
                *(Method(rung, "chain", *transfer.on_rung(rung, transfer.chain)) for rung in ("closed-form", "force", "string", "beam", "violin")),
                Method("violin", "dense", *transfer.on_rung("violin", transfer.dense)),
            ),
            views={"Response up to 50 Hz, by rung": LOW, "Response at 100 Hz and 1 kHz, by rung": HIGH},
        ),
        Quantity(
            name="response-digits",
            title="Response from 1 Hz to 1 kHz, arithmetic alone",
            start=FROM_MATRICES,
            item="frequency",
            count=transfer.SWEEP,
            against=EXACT_STRING,
            reference=transfer.digits_reference,
            error=relative(FREQUENCIES),
            methods=tuple(
                Method("string", name, *transfer.on_model(solve))
                for name, solve in (
                    ("chain", transfer.chain),
                    ("dense", transfer.dense),
                    ("modal sum", transfer.modal_sum),
                    ("state space", transfer.state_space),
                    ("zpk", transfer.zeros_and_poles),
                )
            ),
            views={},
        ),
        Quantity(
            name="thermal",
            title="Thermal noise at 10 and 100 Hz",
            start=FROM_MATRICES,
            item="frequency",
            count=noise.SWEEP,
            against="the {top} rung: motion in 50 digits, then what each part dissipates in it",
            reference=noise.reference,
            error=relative(NOISE),
            methods=tuple(
                Method(rung, name, *noise.method(rung, solve), unsuited=why)
                for rung in ("beam", "violin")
                for name, solve, why in (("dissipation", noise.dissipation, suits), ("susceptibility", noise.susceptibility, noise.one_temperature))
            ),
            views={},
            unsuited=noise.unsuited,
        ),
        Quantity(
            name="coupling",
            title="Cross-coupling at 50 Hz",
            start=FROM_DESIGN,
            item="build",
            count=imperfect.BUILDS,
            against="the {top} rung in the rebuilt equilibrium, its matrices solved in 50 digits",
            reference=imperfect.reference,
            error=relative((COUPLING,)),
            methods=(
                Method("string", "first order", *imperfect.of_builds(imperfect.perturbed)),
                Method("string", "nominal pose", *imperfect.of_builds(lambda s, share: imperfect.stepped(s, share, 0))),
                Method("string", "linear pose", *imperfect.of_builds(lambda s, share: imperfect.stepped(s, share, 1))),
                Method("string", "rebuilt", *imperfect.of_builds(imperfect.rebuilt)),
                Method("beam", "rebuilt", imperfect.of_rung("beam")),
                Method("violin", "rebuilt", imperfect.of_rung("violin")),
            ),
            views={},
            unsuited=imperfect.no_wire,
        ),
        Quantity(
            name="equilibrium",
            title="Equilibrium of an imperfect build",
            start=FROM_DESIGN,
            item="build",
            count=imperfect.BUILDS,
            against="the string rung's equilibrium in 50 digits",
            reference=imperfect.hung,
            error=imperfect.apart,
            methods=(
                Method("string", "linear", *imperfect.steps(1)),
                Method("string", "two steps", *imperfect.steps(2)),
                Method("string", "full", *imperfect.full()),
            ),
            views={},
            unsuited=imperfect.unbalanced,
        ),
    )
}
"""What is compared, by name."""
