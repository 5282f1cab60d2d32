"""Filters of control loops as text for Foton."""

from __future__ import annotations

from suspension_cli.design.foton import format_filter
from suspension_cli.design.schema import Design, Loop


def write(design: Design) -> str:
    """Write the filters of all loops, one design string per loop, with comments."""
    lines = [
        f"# filters of {design.design.name}, plane n (roots in Hz)",
        "# actuator (N or N m) = - filter * sensor (m or rad)",
    ]
    for loop in design.control.loop if design.control is not None else ():
        lines += ["", *_describe(loop)]
    return "\n".join(lines) + "\n"


def _describe(loop: Loop) -> list[str]:
    lines = [f"# {loop.name}: {loop.sensor} -> {loop.actuator}, reference {loop.reference}"]
    if loop.damper is not None:
        lines.append("# a velocity damper: add poles above the band before use in Foton")
    if loop.sensor_response is not None:
        lines.append(f"# not included: response of the sensor {loop.sensor_response}")
    if loop.delay:
        lines.append(f"# not included: delay of {loop.delay:g} s")
    return [*lines, format_filter(loop.controller)]
