"""What must be solved for quantities, merged over all of a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Protocol

from suspension_cli.linear.signals import Signal


class HasNeeds(Protocol):
    """A quantity, as far as `Needs` know it."""

    @property
    def needs(self) -> Needs:
        """What must be solved for it."""
        ...


@dataclass(frozen=True)
class Needs:
    """What must be solved for some quantities; frequencies in Hz.

    Attributes
    ----------
    inputs, outputs, frequency
        Of responses.
    warm_motions, warm_frequency
        Motions whose thermal noise is needed, and where.
    noisy_motions, noisy_frequency
        Motions whose noise by all causes is needed, and where.
    """

    inputs: tuple[Signal, ...] = ()
    outputs: tuple[Signal, ...] = ()
    frequency: tuple[float, ...] = ()
    warm_motions: tuple[Signal, ...] = ()
    warm_frequency: tuple[float, ...] = ()
    noisy_motions: tuple[Signal, ...] = ()
    noisy_frequency: tuple[float, ...] = ()

    @staticmethod
    def of(quantities: Sequence[HasNeeds]) -> Needs:
        """Merge the needs of quantities, each once.

        >>> Needs.of([])
        Needs(inputs=(), outputs=(), frequency=(), warm_motions=(), warm_frequency=(), \
noisy_motions=(), noisy_frequency=())
        """
        merged = {}
        for field in fields(Needs):
            every = [item for one in quantities for item in getattr(one.needs, field.name)]
            merged[field.name] = tuple(dict.fromkeys(every))
        return Needs(**merged)
