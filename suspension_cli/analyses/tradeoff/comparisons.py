"""List of all comparisons. Adding a method takes an entry here."""

from __future__ import annotations

from suspension_cli.analyses.tradeoff import (
    eigenmodes_compared,
    eigenvalues,
    imperfect_builds,
    thermal_noise,
    transfer_functions,
)
from suspension_cli.analyses.tradeoff.comparison import (
    TOP,
    Comparison,
    Method,
    hertz,
    relative,
    suits,
)
from suspension_cli.analyses.tradeoff.subject import (
    COUPLING,
    FREQUENCIES,
    MODEL_NAMES,
    NOISE,
    STRING,
    Subject,
)
from suspension_cli.models import registry

FROM_DESIGN = "from the design to the result"
FROM_MATRICES = "from the matrices to the result"
LOW, HIGH = (tuple(hertz(f) for f in FREQUENCIES if (f <= 50) == low) for low in (True, False))
BANDS = {"Response up to 50 Hz": LOW, "Response at 100 Hz and 1 kHz": HIGH}


def exact_string(_: Subject) -> str:
    """Describe the reference of methods that solve the string model."""
    return "matrices of the string model in 50 digits"


MODES = (
    Comparison(
        quantity="modes",
        compares="models",
        title="Mode frequencies",
        start=FROM_DESIGN,
        item="design",
        count=eigenmodes_compared.DESIGNS,
        against=lambda s: f"the {s.top} model, modes paired by shape",
        reference=eigenmodes_compared.reference,
        error=eigenmodes_compared.error,
        methods=(
            Method(
                registry.CLOSED_FORM.name,
                "formulas",
                eigenmodes_compared.formulas,
                eigenmodes_compared.formulas_batch,
            ),
            Method(
                registry.FORCE.name,
                "blocks",
                lambda s: eigenmodes_compared.solve_blocks(s, registry.FORCE.name),
                eigenmodes_compared.force_batch,
            ),
            Method(
                STRING,
                "blocks",
                lambda s: eigenmodes_compared.solve_blocks(s, STRING),
                eigenmodes_compared.string_batch,
            ),
            Method(
                registry.BEAM.name,
                "blocks",
                lambda s: eigenmodes_compared.solve_blocks(s, registry.BEAM.name),
                eigenmodes_compared.beam_batch,
            ),
            Method(registry.VIOLIN.name, "counted", eigenmodes_compared.solve_with_wire_mass),
        ),
        views={},
    ),
    Comparison(
        quantity="modes",
        compares="methods",
        title="Mode frequencies",
        start=FROM_MATRICES,
        item="design",
        count=eigenmodes_compared.DESIGNS,
        against=exact_string,
        reference=eigenvalues.reference,
        error=eigenvalues.error,
        methods=(
            Method(STRING, "blocks", eigenvalues.by_block, eigenvalues.BY_BLOCK),
            Method(STRING, "dense", eigenvalues.whole, eigenvalues.WHOLE),
            Method(STRING, "eigvalsh", eigenvalues.symmetric, eigenvalues.SYMMETRIC),
            Method(STRING, "eig(M⁻¹K)", eigenvalues.unsymmetric, eigenvalues.UNSYMMETRIC),
            Method(STRING, "state-space poles", eigenvalues.poles),
            Method(STRING, "counted", eigenvalues.bisected),
        ),
        views={},
    ),
)

RESPONSES = (
    Comparison(
        quantity="response",
        compares="models",
        title="Response",
        start=FROM_DESIGN,
        item="frequency",
        count=transfer_functions.SWEEP,
        against=lambda s: f"the {s.top} model, solved in 50 digits",
        reference=lambda s: transfer_functions.reference(s, s.top),
        error=relative(FREQUENCIES),
        methods=tuple(
            Method(model, "chain", *transfer_functions.with_model(model)) for model in MODEL_NAMES
        ),
        views=BANDS,
    ),
    Comparison(
        quantity="response",
        compares="methods",
        title="Response",
        start=FROM_MATRICES,
        item="frequency",
        count=transfer_functions.SWEEP,
        against=exact_string,
        reference=lambda s: transfer_functions.reference(s, STRING),
        error=relative(FREQUENCIES),
        methods=tuple(
            Method(STRING, f"{name}{end}", *timed(prepare))
            for name, prepare in transfer_functions.METHODS.items()
            for end, timed in (
                ("", transfer_functions.prepared),
                (", kept", transfer_functions.kept),
            )
        ),
        views=BANDS,
    ),
)

THERMAL = (
    Comparison(
        quantity="thermal",
        compares="models",
        title="Thermal noise at 10 and 100 Hz",
        start=FROM_DESIGN,
        item="frequency",
        count=thermal_noise.SWEEP,
        against=lambda s: f"the {s.top} model, solved in 50 digits",
        reference=thermal_noise.reference,
        error=relative(NOISE),
        methods=tuple(
            Method(
                model,
                "dissipation",
                *thermal_noise.with_model(model),
                unsuited=thermal_noise.not_localised(model),
            )
            for model in MODEL_NAMES
        ),
        views={},
        unsuited=thermal_noise.unsuited,
    ),
    Comparison(
        quantity="thermal",
        compares="methods",
        title="Thermal noise at 10 and 100 Hz",
        start=FROM_MATRICES,
        item="frequency",
        count=thermal_noise.SWEEP,
        against=lambda s: f"matrices of the {s.top} model in 50 digits",
        reference=thermal_noise.reference,
        error=relative(NOISE),
        methods=(
            Method(
                TOP,
                "dissipation",
                *thermal_noise.on_matrices(thermal_noise.dissipation),
                unsuited=suits,
            ),
            Method(
                TOP,
                "susceptibility",
                *thermal_noise.on_matrices(thermal_noise.susceptibility),
                unsuited=thermal_noise.one_temperature,
            ),
        ),
        views={},
        unsuited=thermal_noise.unsuited,
    ),
)

IMPERFECT = (
    Comparison(
        quantity="coupling",
        compares="models",
        title="Cross-coupling at 50 Hz",
        start=FROM_DESIGN,
        item="build",
        count=imperfect_builds.BUILDS,
        against=lambda s: f"the {s.imperfect.top} model in its equilibrium, solved in 50 digits",
        reference=lambda s: imperfect_builds.reference(s, s.imperfect.top),
        error=relative((COUPLING,)),
        methods=tuple(
            Method(
                model,
                "rebuilt",
                imperfect_builds.one(imperfect_builds.with_model(model)),
                imperfect_builds.batch(imperfect_builds.with_model(model)),
                imperfect_builds.fails(model),
            )
            for model in MODEL_NAMES
        ),
        views={},
        unsuited=imperfect_builds.incomparable,
    ),
    Comparison(
        quantity="coupling",
        compares="methods",
        title="Cross-coupling at 50 Hz",
        start=FROM_DESIGN,
        item="build",
        count=imperfect_builds.BUILDS,
        against=lambda _: "the string model in its equilibrium, solved in 50 digits",
        reference=lambda s: imperfect_builds.reference(s, STRING),
        error=relative((COUPLING,)),
        methods=tuple(
            Method(STRING, name, imperfect_builds.one(solve), imperfect_builds.batch(solve))
            for name, solve in (
                ("first order", imperfect_builds.perturbed),
                ("nominal pose", imperfect_builds.in_nominal_pose),
                ("linear pose", imperfect_builds.in_linear_pose),
                ("rebuilt", imperfect_builds.rebuilt),
            )
        ),
        views={},
        unsuited=imperfect_builds.uncoupled,
    ),
    Comparison(
        quantity="equilibrium",
        compares="methods",
        title="Equilibrium of an imperfect build",
        start=FROM_DESIGN,
        item="build",
        count=imperfect_builds.BUILDS,
        against=lambda _: "equilibrium of the string model in 50 digits",
        reference=imperfect_builds.equilibrium_reference,
        error=imperfect_builds.equilibrium_error,
        methods=(
            Method(STRING, "linear", *imperfect_builds.steps(1)),
            Method(STRING, "two steps", *imperfect_builds.steps(2)),
            Method(STRING, "full", *imperfect_builds.full()),
        ),
        views={},
        unsuited=imperfect_builds.unbalanced,
    ),
)

COMPARISONS: tuple[Comparison, ...] = (*MODES, *RESPONSES, *THERMAL, *IMPERFECT)
QUANTITIES: tuple[str, ...] = tuple(dict.fromkeys(item.quantity for item in COMPARISONS))
