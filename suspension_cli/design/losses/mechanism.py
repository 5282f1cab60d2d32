"""Interface of a mechanism of loss, and the tables of the design file that give its constants."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, ClassVar, Self

from suspension_cli.design.tables import Problems, Table, extend_table

if TYPE_CHECKING:
    from suspension_cli.design.cross_sections.shape import CrossSection, Frequencies, Spectrum


class Mechanism:
    """A mechanism of loss, with the constants of one material: a frozen dataclass.

    Materials are tables `schema.Material`, with None for what is unknown.

    Loss angles are in rad, finite at zero frequency, and add up; `omega` is in rad/s, of any shape,
    not negative, or complex (of a damped mode).

    Attributes
    ----------
    name
        For messages.
    keys
        Its keys in ``[materials.NAME.loss]``: types by name.
    uniform
        Whether it acts in every deformation; otherwise in bending alone.
    cause
        Cause under which `pendsus thermal` lists its dissipation in the bending of wires:
        ``clamps`` for ``test.clamps``; "" to list it with the bending of either end.
    """

    name: ClassVar[str]
    keys: ClassVar[dict[str, Any]] = {}
    uniform: ClassVar[bool] = False
    cause: ClassVar[str] = ""

    @classmethod
    def merge(cls, own: Any, built_in: Any) -> dict[str, object]:
        """Merge a design's values of the keys of a material with built-in ones."""
        values = ((key, getattr(own.loss, key, None)) for key in cls.keys)
        return {
            key: getattr(built_in.loss, key) if value is None else value for key, value in values
        }

    @classmethod
    def check(cls, own: Any, material: Any) -> Problems:
        """Check a design's table of a material; `material` has the built-in values too.

        Bounds of single numbers are in their types.
        """
        del own, material
        yield from ()

    @classmethod
    def of(cls, material: Any, wire: Table | None) -> Self | None:
        """Read the constants.

        Parameters
        ----------
        material
            With the values that `merge` makes.
        wire
            Table of the wire; None for a blade.

        Returns
        -------
        Mechanism or None
            None if this mechanism does not act.
        """
        raise NotImplementedError

    def bending(
        self, shape: CrossSection, plane: int, omega: Frequencies, temperature: float
    ) -> Spectrum:
        """Loss angle of bending in one plane; with a `coefficient` a, divided by a^2."""
        raise NotImplementedError

    def stretching(self, shape: CrossSection, omega: Frequencies) -> Spectrum:
        """Loss angle of stretching, and by default of twisting; 0 unless `uniform`."""
        import numpy as np

        del shape
        return np.zeros(np.shape(omega))

    twisting = stretching

    def coefficient(self, area: float) -> tuple[float, float] | None:
        """(p, q) of a bending angle proportional to a^2, with a = p - q T at the tension T (N).

        At most one mechanism of a material has it.
        """
        del area
        return None

    @property
    def acts_unstrained(self) -> bool:
        """Whether it has a loss without static strain."""
        return True


def with_keys(base: type[Table], mechanisms: Iterable[type[Mechanism]]) -> Any:
    """Derive a table of the design file from `base`, with the keys of all mechanisms."""
    keys = {name: kind for one in mechanisms for name, kind in one.keys.items()}
    return extend_table(base, {name: kind | None for name, kind in keys.items()})
