"""Names of the models, from the cheapest to the most complete; importing them costs nothing."""

CLOSED_FORM, FORCE, STRING, BEAM, VIOLIN = "closed-form", "force", "string", "beam", "violin"
AUTO = "auto"
LEVELS = (AUTO, CLOSED_FORM, FORCE, STRING, BEAM, VIOLIN)
"""Values of ``--fidelity``."""
