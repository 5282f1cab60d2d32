"""All comparisons; a new method takes an entry here."""

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
)
from suspension_cli.models.registry import BEAM, CLOSED_FORM, FORCE, VIOLIN

FROM_DESIGN = "from the design to the result"
FROM_MATRICES = "from the matrices to the result"
EXACT_STRING = "matrices of the string model in 50 digits"
LOW, HIGH = (tuple(hertz(f) for f in FREQUENCIES if (f <= 50) == low) for low in (True, False))
BANDS = {"Response up to 50 Hz": LOW, "Response at 100 Hz and 1 kHz": HIGH}

MODES = ("Mode frequencies", "design", eigenmodes_compared.DESIGNS)
RESPONSE = ("Response", "frequency", transfer_functions.SWEEP)
THERMAL = ("Thermal noise at 10 and 100 Hz", "frequency", thermal_noise.SWEEP)
COUPLED = ("Cross-coupling at 50 Hz", "build", imperfect_builds.BUILDS)
EQUILIBRIUM = ("Equilibrium of an imperfect build", "build", imperfect_builds.BUILDS)
"""Title of each quantity, item of a batch, and items per batch."""

COMPARISONS = (
    Comparison(
        "modes",
        "models",
        *MODES,
        start=FROM_DESIGN,
        against=lambda s: f"the {s.top} model, modes paired by shape",
        reference=eigenmodes_compared.reference,
        error=eigenmodes_compared.error,
        methods=(
            Method(
                CLOSED_FORM.name,
                "formulas",
                eigenmodes_compared.formulas,
                eigenmodes_compared.formulas_batch,
            ),
            *(
                Method(level, "blocks", eigenmodes_compared.by_block(level), batch)
                for level, batch in (
                    (FORCE.name, eigenmodes_compared.force_batch),
                    (STRING, eigenmodes_compared.string_batch),
                    (BEAM.name, eigenmodes_compared.beam_batch),
                )
            ),
            Method(VIOLIN.name, "counted", eigenmodes_compared.solve_with_wire_mass),
        ),
    ),
    Comparison(
        "modes",
        "methods",
        *MODES,
        start=FROM_MATRICES,
        against=lambda _: EXACT_STRING,
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
    ),
    Comparison(
        "response",
        "models",
        *RESPONSE,
        start=FROM_DESIGN,
        against=lambda s: f"the {s.top} model, solved in 50 digits",
        reference=lambda s: transfer_functions.reference(s, s.top),
        error=relative(FREQUENCIES),
        methods=tuple(
            Method(level, "chain", *transfer_functions.with_model(level)) for level in MODEL_NAMES
        ),
        views=BANDS,
    ),
    Comparison(
        "response",
        "methods",
        *RESPONSE,
        start=FROM_MATRICES,
        against=lambda _: EXACT_STRING,
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
    Comparison(
        "thermal",
        "models",
        *THERMAL,
        start=FROM_DESIGN,
        against=lambda s: f"the {s.top} model, solved in 50 digits",
        reference=thermal_noise.reference,
        error=relative(NOISE),
        methods=tuple(
            Method(
                level,
                "dissipation",
                *thermal_noise.with_model(level),
                unsuited=thermal_noise.not_localised(level),
            )
            for level in MODEL_NAMES
        ),
        unsuited=thermal_noise.unsuited,
    ),
    Comparison(
        "thermal",
        "methods",
        *THERMAL,
        start=FROM_MATRICES,
        against=lambda s: f"matrices of the {s.top} model in 50 digits",
        reference=thermal_noise.reference,
        error=relative(NOISE),
        methods=tuple(
            Method(TOP, solve.__name__, *thermal_noise.on_matrices(solve), unsuited=why_not)
            for solve, why_not in (
                (thermal_noise.dissipation, suits),
                (thermal_noise.susceptibility, thermal_noise.one_temperature),
            )
        ),
        unsuited=thermal_noise.unsuited,
    ),
    Comparison(
        "coupling",
        "models",
        *COUPLED,
        start=FROM_DESIGN,
        against=lambda s: f"the {s.imperfect.top} model in its equilibrium, solved in 50 digits",
        reference=lambda s: imperfect_builds.reference(s, s.imperfect.top),
        error=relative((COUPLING,)),
        methods=tuple(
            Method(
                level,
                "rebuilt",
                *imperfect_builds.coupling(imperfect_builds.with_model(level)),
                unsuited=imperfect_builds.fails(level),
            )
            for level in MODEL_NAMES
        ),
        unsuited=imperfect_builds.incomparable,
    ),
    Comparison(
        "coupling",
        "methods",
        *COUPLED,
        start=FROM_DESIGN,
        against=lambda _: "the string model in its equilibrium, solved in 50 digits",
        reference=lambda s: imperfect_builds.reference(s, STRING),
        error=relative((COUPLING,)),
        methods=tuple(
            Method(STRING, name, *imperfect_builds.coupling(solve))
            for name, solve in (
                ("first order", imperfect_builds.perturbed),
                ("nominal pose", imperfect_builds.after_newton_steps(0)),
                ("linear pose", imperfect_builds.after_newton_steps(1)),
                ("rebuilt", imperfect_builds.rebuilt),
            )
        ),
        unsuited=imperfect_builds.uncoupled,
    ),
    Comparison(
        "equilibrium",
        "methods",
        *EQUILIBRIUM,
        start=FROM_DESIGN,
        against=lambda _: "equilibrium of the string model in 50 digits",
        reference=imperfect_builds.equilibrium_reference,
        error=imperfect_builds.equilibrium_error,
        methods=(
            Method(STRING, "linear", *imperfect_builds.steps(1)),
            Method(STRING, "two steps", *imperfect_builds.steps(2)),
            Method(STRING, "full", *imperfect_builds.full()),
        ),
        unsuited=imperfect_builds.unbalanced,
    ),
)
QUANTITIES = tuple(dict.fromkeys(item.quantity for item in COMPARISONS))
