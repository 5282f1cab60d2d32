"""Conversion of files of other programs into designs.

**gwinc.** See `gwinc_suspension`.

**SUMCON**, KAGRA's modeller of suspensions in Mathematica: `save` reads, `convert` writes.
SUMCON's y is vertical and its z along the beam: its x, y, z are y, z, x here. It minimises the
energy of wires with natural lengths. A wire is a string between hinges, sqrt(E I / T) from each
clamp, with the diameter of its ends and a tension T of its own in the save. A vertical spring moves
the upper end of a wire, an inverted pendulum holds a body by a lateral stiffness that includes the
load, a heat link is a stiffness between two points.

A body hangs from one other. Where its wires and all below are symmetric, they are a set, whose
loaded length is the natural length plus T / k, with T from the weight. Other wires keep their
natural lengths, so that the pose is solved for.
"""
