"""Results by name, among which modes of the nominal design may be meant by number, or all.

``5`` and ``modes`` are modes of the nominal design, each of which is followed to other designs by
its shape, so that its line in a sweep is continuous. All other names mean in each design what they
mean anywhere else (`quantities.vocabulary`).
"""

from __future__ import annotations

from collections.abc import Sequence

from suspension_cli.errors import InputError, format_value, gather
from suspension_cli.grids import parse_place
from suspension_cli.linear import eigenmodes
from suspension_cli.quantities import vocabulary
from suspension_cli.quantities.kinds.modes import ALL, FollowedMode, Frequency
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.studies.job import nominal_system


def find_results(texts: Sequence[str], names: Names, text: str, level: str) -> tuple[Quantity, ...]:
    """Look up results by name, each once; all modes if there are none.

    `text` is the nominal design as TOML, `level` the model in which its modes are numbered and
    labelled. Raises `InputError` with all that the design lacks.
    """
    modes = follow_all(text, level)

    def find(one: str) -> Sequence[Quantity]:
        plain = one.strip()
        if plain == ALL:
            return modes
        if not (plain.isascii() and plain.isdigit()):
            return [vocabulary.parse(plain, names)]
        place = parse_place(plain, len(modes))
        if place is None:
            problem = f"is no number of a mode in the {level} model"
            remedy = f"give 1 to {len(modes)}"
            raise InputError.of("--result", problem, remedy, format_value(plain))
        return [modes[place]]

    found = [one for some in gather(find, list(texts) or [ALL]) for one in some]
    by_label = {one.text for one in found if isinstance(one, Frequency)}
    return tuple(dict.fromkeys(_rename(one, by_label) for one in found))


def follow_all(text: str, level: str) -> list[FollowedMode]:
    """Follow every mode of a nominal design (TOML), by its label in a model."""
    labels = eigenmodes.solve(nominal_system(text, level)).label
    return [FollowedMode(label, "Hz", n, text) for n, label in enumerate(labels)]


def _rename(quantity: Quantity, by_label: set[str]) -> Quantity:
    """Tell a mode that is followed from the one that is asked for by the same label."""
    if isinstance(quantity, FollowedMode) and quantity.text in by_label:
        return quantity.with_number()
    return quantity
