"""Insertion and removal of the keystones of filters as stages of a design."""

from __future__ import annotations

import msgspec

from suspension_cli.design.filters import SUFFIX, keystone_inertia
from suspension_cli.design.schema import Body, Design, Stage


class Keystone(Stage, frozen=True):
    """The keystone of a filter: a stage that is not in the file, held by the filter's blades.

    Attributes
    ----------
    blades_of
        Name of the stage with the filter.
    """

    blades_of: str


def add_keystones(design: Design) -> Design:
    """Insert the keystone of each filter as a stage after that of the filter."""
    if all(stage.filter is None for stage in design.stage):
        return design
    stages: list[Stage] = []
    for stage in design.stage:
        stages.append(stage)
        if stage.filter is not None:
            keystone = stage.filter.keystone
            stages.append(
                Keystone(
                    name=stage.name + SUFFIX,
                    body=Body(mass=keystone.mass, inertia=list(keystone_inertia(keystone))),
                    position=stage.filter.at,
                    blades_of=stage.name,
                )
            )
    return msgspec.structs.replace(design, stage=stages)


def drop_keystones(design: Design) -> Design:
    """Remove the stages that `add_keystones` inserted."""
    stages = [stage for stage in design.stage if not isinstance(stage, Keystone)]
    if len(stages) == len(design.stage):
        return design
    return msgspec.structs.replace(design, stage=stages)


def filter_of(design: Design, keystone: Keystone) -> Stage:
    """Find the stage with the filter of a keystone."""
    return next(stage for stage in design.stage if stage.name == keystone.blades_of)
