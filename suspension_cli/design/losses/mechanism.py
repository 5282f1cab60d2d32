"""Interface of a mechanism of loss, and the tables of the design file that give its constants."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Protocol, Self

from msgspec import defstruct

from suspension_cli.design.units import Table

if TYPE_CHECKING:
    from suspension_cli.design.cross_sections.shape import Frequencies, Spectrum
    from suspension_cli.errors import Fault


@dataclass(frozen=True)
class Key:
    """A key of the design file.

    Attributes
    ----------
    kind
        With its unit, bounds and help text.
    table : {"material", "wire"}
        ``[materials.NAME.loss]``, or the tables of wires.
    """

    name: str
    kind: Any
    table: Literal["material", "wire"] = "material"


class MaterialConstants(Protocol):
    """Constants of a material, None where unknown, with its losses in `loss`."""

    @property
    def youngs_modulus(self) -> float | None:
        """Pa."""
        ...

    @property
    def density(self) -> float | None:
        """kg/m^3."""
        ...

    @property
    def thermal_expansion(self) -> float | None:
        """1/K."""
        ...

    @property
    def modulus_slope(self) -> float | None:
        """(1/E) dE/dT, 1/K."""
        ...

    @property
    def specific_heat(self) -> float | None:
        """J/(kg K)."""
        ...

    @property
    def thermal_conductivity(self) -> float | None:
        """W/(m K)."""
        ...

    @property
    def loss(self) -> Any:
        """Table with the keys of all mechanisms, or None."""
        ...

    @property
    def loss_angle(self) -> float | None:
        """Short for `loss.angle`, rad."""
        ...


class Shape(Protocol):
    """Properties of the cross-section of a wire or blade that losses depend on."""

    @property
    def depth(self) -> tuple[float, float]:
        """Size across in the two planes of bending, m."""
        ...

    @property
    def stretching_ratio(self) -> float:
        """mu S/V of stretching, 1/m."""
        ...

    @property
    def twisting_ratio(self) -> float:
        """mu S/V of twisting, 1/m."""
        ...

    def bending_ratio(self, plane: int) -> float:
        """mu S/V of bending, 1/m."""
        ...

    def relaxation(self, phase: Frequencies) -> Spectrum:
        """Thermoelastic loss angle of bending over its strength."""
        ...


class Mechanism:
    """A mechanism of loss, with the constants of one material: a frozen dataclass.

    Loss angles are in rad, finite at zero frequency, and add up; `omega` is in rad/s, of any shape,
    not negative, or complex (of a damped mode).

    Attributes
    ----------
    name
        For messages.
    uniform
        Whether it acts in every deformation; otherwise in bending alone.
    cause
        Cause under which `pendsus thermal` lists its dissipation in the bending of wires:
        ``clamps`` for ``test.clamps``; "" to list it with the bending of either end.
    """

    name: ClassVar[str]
    keys: ClassVar[tuple[Key, ...]] = ()
    uniform: ClassVar[bool] = False
    cause: ClassVar[str] = ""

    @classmethod
    def merge(cls, own: MaterialConstants, built_in: MaterialConstants) -> dict[str, object]:
        """Merge a design's values of the keys of a material with built-in ones."""
        result = {}
        for key in cls.keys:
            if key.table == "material":
                given = getattr(own.loss, key.name, None)
                result[key.name] = given if given is not None else getattr(built_in.loss, key.name)
        return result

    @classmethod
    def check(
        cls, own: MaterialConstants, material: MaterialConstants, path: str
    ) -> Iterator[Fault]:
        """Check a design's table of a material at `path`; `material` has the built-in values too.

        Bounds of single numbers are in their types.
        """
        del own, material, path
        yield from ()

    @classmethod
    def check_wire(cls, wire: Table, path: str) -> Iterator[Fault]:
        """Check the keys in the table of wires at `path`."""
        del wire, path
        yield from ()

    @classmethod
    def of(cls, material: MaterialConstants, wire: Table | None) -> Self | None:
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
        self,
        shape: Shape,
        plane: int,
        omega: Frequencies,
        temperature: float,
    ) -> Spectrum:
        """Loss angle of bending in one plane; with a `coefficient` a, divided by a^2."""
        raise NotImplementedError

    def stretching(self, shape: Shape, omega: Frequencies) -> Spectrum:
        """Loss angle of stretching; 0 unless `uniform`."""
        import numpy as np

        del shape
        return np.zeros(np.shape(omega))

    def twisting(self, shape: Shape, omega: Frequencies) -> Spectrum:
        """Loss angle of twisting; 0 unless `uniform`."""
        import numpy as np

        del shape
        return np.zeros(np.shape(omega))

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


def with_keys(base: type[Table], mechanisms: Iterable[type[Mechanism]], table: str) -> Any:
    """Derive a table of the design file from `base`, with the keys of all mechanisms."""
    fields: list[Any] = [
        (key.name, key.kind | None, None)
        for mechanism in mechanisms
        for key in mechanism.keys
        if key.table == table
    ]
    return defstruct(
        f"_{table.title()}Loss",
        fields,
        bases=(base,),
        frozen=True,
        kw_only=True,
        module=base.__module__,
    )
