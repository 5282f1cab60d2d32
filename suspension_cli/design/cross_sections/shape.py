"""Properties that each cross-section of a wire has.

Nothing else depends on the shape. Bending in plane 0 moves the wire along the thickness of a ribbon
(its soft plane), in plane 1 along its width.

**Surface loss.**  A layer at the surface is lossier than the bulk. It adds phi_bulk d_s mu S/V to
the loss angle phi_bulk of the bulk, where the dissipation depth d_s is a property of the finish and

    mu S/V = (integral of e^2 over the surface) / (integral of e^2 over the volume)

for the strain e of the deformation (Gretarsson and Harry, Rev. Sci. Instrum. 70, 4081 (1999)). The
methods `..._ratio` give it for each deformation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Self

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Inexact

    Spectrum = Inexact[np.ndarray, "*frequency"]
    Frequencies = Spectrum | complex
    """Angular frequencies or phases: real, or complex for the analytic continuation."""


class CrossSection:
    """Cross-section of a wire; sizes in m.

    Attributes
    ----------
    key
        Key in the tables of wires.
    wire
        The wire that has it, for messages.
    form
        How to give it, for messages.
    round
        Whether it is the same in all directions across the wire.
    order
        Order n of its thermoelastic relaxation, see `cross_sections.relaxation`.
    """

    __slots__ = ()
    key: ClassVar[str]
    wire: ClassVar[str]
    form: ClassVar[str]
    round: ClassVar[bool] = False
    order = 0.5

    @classmethod
    def read(cls, value: Any) -> Self:
        """Make a cross-section from the value of its key."""
        return value

    @property
    def area(self) -> float:
        """Area for stretching, m^2."""
        raise NotImplementedError

    @property
    def least_area(self) -> float:
        """Smallest area along the wire, m^2, where stress is largest."""
        return self.area

    @property
    def depth(self) -> tuple[float, float]:
        """Size across the wire in the two planes of bending, m."""
        raise NotImplementedError

    @property
    def moments(self) -> tuple[float, float]:
        """Second moments of area for bending in the two planes, m^4."""
        raise NotImplementedError

    @property
    def torsion(self) -> float:
        """Torsion constant J, m^4."""
        raise NotImplementedError

    @property
    def polar_area(self) -> float:
        """Polar second moment of area over area, I_p/A in m^2, by which tension resists torsion."""
        raise NotImplementedError

    @property
    def bulk(self) -> tuple[float, float]:
        """Volume per length (m^2) and its polar moment per length (m^4), for mass and inertia."""
        return self.area, sum(self.moments)

    def bending_ratio(self, plane: int) -> float:
        """mu S/V of bending in one plane, 1/m.

        e ~ y, the distance from the neutral line. Of a ribbon with the depth d in the plane and the
        breadth b: two faces b (d/2)^2 each and two edges d^3/12 each, over b d^3/12: 6/d + 2/b. Of
        a round wire (pi r^3)/(pi r^4/4) = 8/d, the same for b = d.
        """
        return 6 / self.depth[plane] + 2 / self.depth[1 - plane]

    @property
    def stretching_ratio(self) -> float:
        """mu S/V of stretching, 1/m: circumference over area, as the strain is uniform."""
        return 2 / self.depth[0] + 2 / self.depth[1]

    @property
    def twisting_ratio(self) -> float:
        """mu S/V of twisting, 1/m."""
        raise NotImplementedError

    def relaxation(self, phase: Frequencies) -> Spectrum:
        """Thermoelastic loss angle of bending in a plane over its strength Delta.

        Parameters
        ----------
        phase
            w h^2/D, with h half the `depth` in the plane and D the diffusivity; complex for the
            analytic continuation.
        """
        from suspension_cli.design.cross_sections.relaxation import relaxation  # numpy

        return relaxation(phase, self.order)

    def drag(self, normal: float, along: float) -> tuple[float, float, float, float]:
        """Drag of a thin gas per length of wire.

        Parameters
        ----------
        normal, along
            Of a surface that moves along its normal or slides, per area and velocity, N s/m^3.

        Returns
        -------
        first, second, along, turning : float
            Of motion in the two planes of bending and along the wire, N s/m^2, and of rotation
            about its axis, N s.
        """
        raise NotImplementedError
