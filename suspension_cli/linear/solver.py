"""A linear system with what is prepared to solve it repeatedly.

>>> from suspension_cli.design import reader
>>> from suspension_cli.models import registry
>>> solver = Solver(registry.BEAM.system(reader.parse(reader.template("single", "single"))))
>>> solver.constant.modes.label[0]
'test transverse'

A `LinearSystem` is plain data: functions that solve one prepare its equations each time. Whoever
solves a system more than once makes one `Solver` of it and passes that instead. It owns the blocks
with the order of their elimination, and undamped modes; each is prepared when it is first needed.
"""

from __future__ import annotations

from functools import cached_property
from typing import TypeAlias

from suspension_cli.linear import batch_modes, eigenmodes
from suspension_cli.linear.batch_modes import Spectrum
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.pencil import Block, Pencil
from suspension_cli.linear.structure import Structure
from suspension_cli.linear.system import LinearSystem


class Solver:
    """What is prepared to solve one system, without batch axes.

    Attributes
    ----------
    system
        The system, which does not change.
    """

    def __init__(self, system: LinearSystem) -> None:
        self.system = system

    @staticmethod
    def of(system: Solvable) -> Solver:
        """Make the solver of a system; a solver is returned as it is."""
        return system if isinstance(system, Solver) else Solver(system)

    @cached_property
    def structure(self) -> Structure:
        """Couplings of the coordinates."""
        return Structure(self.system)

    @cached_property
    def pencil(self) -> Pencil:
        """Equations at any frequency."""
        return Pencil(self.structure)

    @cached_property
    def blocks(self) -> list[Block]:
        """Blocks of the equations, which keep the order of their elimination."""
        return self.pencil.make_blocks()

    @cached_property
    def spectrum(self) -> Spectrum:
        """Undamped modes as arrays; terms in frequency only say what couples."""
        return batch_modes.solve(self.system, self.structure.blocks)

    @cached_property
    def modes(self) -> Modes:
        """Undamped modes, with Q to first order in the losses."""
        return eigenmodes.solve(self.system, self.spectrum)

    @cached_property
    def constant(self) -> Solver:
        """Solver of the system without its terms in frequency."""
        return Solver(self.system.constant) if self.system.terms else self

    @cached_property
    def driven_by_ground(self) -> Solver:
        """Solver of the system with the motion of the ground in place of the support's."""
        return Solver(self.system.driven_by_ground)


Solvable: TypeAlias = LinearSystem | Solver
"""A system, or its solver if it is solved more than once."""
