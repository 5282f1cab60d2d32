"""Everything that is compared.  A method more is an entry more here."""

from __future__ import annotations

from suspension_cli.analysis.tradeoff import eigen, imperfect, noise, spectra, transfer
from suspension_cli.analysis.tradeoff.registry import TOP, Comparison, Method, hertz, relative, suits
from suspension_cli.analysis.tradeoff.subject import COUPLING, FREQUENCIES, NOISE, RUNGS, Subject

FROM_DESIGN = "from the design to the result"
FROM_MATRICES = "from the matrices to the result"
LOW, HIGH = (tuple(hertz(f) for f in FREQUENCIES if (f <= 50) == low) for low in (True, False))
BANDS = {"Response up to 50 Hz": LOW, "Response at 100 Hz and 1 kHz": HIGH}


def exact_string(_: Subject) -> str:
    """What methods on the string rung are compared with."""
    return "the string rung's own matrices in 50 digits"


MODES = (
    Comparison(
        quantity="modes",
        compares="rungs",
        title="Mode frequencies",
        start=FROM_DESIGN,
        item="design",
        count=eigen.DESIGNS,
        against=lambda s: f"the {s.top} rung, modes paired by shape",
        reference=eigen.reference,
        error=eigen.error,
        methods=(
            Method("closed-form", "formulas", eigen.formulas, eigen.formulas_batch),
            Method("force", "blocks", lambda s: eigen.solved(s, "force"), eigen.force_batch),
            Method("string", "blocks", lambda s: eigen.solved(s, "string"), eigen.string_batch),
            Method("beam", "blocks", lambda s: eigen.solved(s, "beam"), eigen.beam_batch),
            Method("violin", "counted", eigen.counted),
        ),
        views={},
    ),
    Comparison(
        quantity="modes",
        compares="methods",
        title="Mode frequencies",
        start=FROM_MATRICES,
        item="design",
        count=eigen.DESIGNS,
        against=exact_string,
        reference=spectra.reference,
        error=spectra.error,
        methods=(
            Method("string", "blocks", spectra.by_block, spectra.BY_BLOCK),
            Method("string", "dense", spectra.whole, spectra.WHOLE),
            Method("string", "eigvalsh", spectra.symmetric, spectra.SYMMETRIC),
            Method("string", "eig(M⁻¹K)", spectra.unsymmetric, spectra.UNSYMMETRIC),
            Method("string", "state-space poles", spectra.poles),
            Method("string", "counted", spectra.bisected),
        ),
        views={},
    ),
)

RESPONSES = (
    Comparison(
        quantity="response",
        compares="rungs",
        title="Response",
        start=FROM_DESIGN,
        item="frequency",
        count=transfer.SWEEP,
        against=lambda s: f"the {s.top} rung, solved in 50 digits",
        reference=transfer.reference,
        error=relative(FREQUENCIES),
        methods=tuple(Method(rung, "chain", *transfer.on_rung(rung)) for rung in RUNGS),
        views=BANDS,
    ),
    Comparison(
        quantity="response",
        compares="methods",
        title="Response",
        start=FROM_MATRICES,
        item="frequency",
        count=transfer.SWEEP,
        against=exact_string,
        reference=transfer.digits_reference,
        error=relative(FREQUENCIES),
        methods=(
            Method("string", "chain", *transfer.prepared(transfer.chained)),
            Method("string", "chain, kept", *transfer.kept(transfer.chained)),
            Method("string", "dense", *transfer.on_matrices(transfer.dense)),
            Method("string", "modal sum", *transfer.prepared(transfer.modal)),
            Method("string", "modal sum, kept", *transfer.kept(transfer.modal)),
            Method("string", "state space", *transfer.prepared(transfer.realised)),
            Method("string", "state space, kept", *transfer.kept(transfer.realised)),
            Method("string", "zpk", *transfer.prepared(transfer.factored)),
            Method("string", "zpk, kept", *transfer.kept(transfer.factored)),
        ),
        views=BANDS,
    ),
)

THERMAL = (
    Comparison(
        quantity="thermal",
        compares="rungs",
        title="Thermal noise at 10 and 100 Hz",
        start=FROM_DESIGN,
        item="frequency",
        count=noise.SWEEP,
        against=lambda s: f"the {s.top} rung, solved in 50 digits",
        reference=noise.reference,
        error=relative(NOISE),
        methods=tuple(Method(rung, "dissipation", *noise.on_rung(rung), unsuited=noise.placeless(rung)) for rung in RUNGS),
        views={},
        unsuited=noise.unsuited,
    ),
    Comparison(
        quantity="thermal",
        compares="methods",
        title="Thermal noise at 10 and 100 Hz",
        start=FROM_MATRICES,
        item="frequency",
        count=noise.SWEEP,
        against=lambda s: f"the {s.top} rung's own matrices in 50 digits",
        reference=noise.reference,
        error=relative(NOISE),
        methods=(
            Method(TOP, "dissipation", *noise.on_matrices(noise.dissipation), unsuited=suits),
            Method(TOP, "susceptibility", *noise.on_matrices(noise.susceptibility), unsuited=noise.one_temperature),
        ),
        views={},
        unsuited=noise.unsuited,
    ),
)

IMPERFECT = (
    Comparison(
        quantity="coupling",
        compares="rungs",
        title="Cross-coupling at 50 Hz",
        start=FROM_DESIGN,
        item="build",
        count=imperfect.BUILDS,
        against=lambda s: f"the {s.imperfect.top} rung in its own equilibrium, solved in 50 digits",
        reference=imperfect.reference,
        error=relative((COUPLING,)),
        methods=tuple(
            Method(rung, "rebuilt", imperfect.one(imperfect.on_rung(rung)), imperfect.batch(imperfect.on_rung(rung)), imperfect.fails(rung)) for rung in RUNGS
        ),
        views={},
        unsuited=imperfect.incomparable,
    ),
    Comparison(
        quantity="coupling",
        compares="methods",
        title="Cross-coupling at 50 Hz",
        start=FROM_DESIGN,
        item="build",
        count=imperfect.BUILDS,
        against=lambda _: "the string rung in its own equilibrium, solved in 50 digits",
        reference=imperfect.string_reference,
        error=relative((COUPLING,)),
        methods=tuple(
            Method("string", name, imperfect.one(solve), imperfect.batch(solve))
            for name, solve in (
                ("first order", imperfect.perturbed),
                ("nominal pose", imperfect.in_nominal_pose),
                ("linear pose", imperfect.in_linear_pose),
                ("rebuilt", imperfect.rebuilt),
            )
        ),
        views={},
        unsuited=imperfect.uncoupled,
    ),
    Comparison(
        quantity="equilibrium",
        compares="methods",
        title="Equilibrium of an imperfect build",
        start=FROM_DESIGN,
        item="build",
        count=imperfect.BUILDS,
        against=lambda _: "the string rung's equilibrium in 50 digits",
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

COMPARISONS: tuple[Comparison, ...] = (*MODES, *RESPONSES, *THERMAL, *IMPERFECT)
QUANTITIES: tuple[str, ...] = tuple(dict.fromkeys(item.quantity for item in COMPARISONS))
