"""Designs to draw."""

from suspension_cli.design import reader
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import eigenmodes as analysis
from suspension_cli.models import registry

SINGLE = """
[design]
name = "single"
title = "Single pendulum"
[[stage]]
name = "test"
body = { mass = 20.0, inertia = [0.147, 0.117, 0.110] }
[stage.wires]
count = 4
l = 0.40
s = 0.025
t1 = 0.0
t2 = 0.133
d = 0.032
material = "steel302"
radius = 142.5e-6
"""

TRIPLE = """
[design]
name = "triple"
title = "Costs $5, or $6\\nall reported"
[[stage]]
name = "top"
body = { shape = "box", size = [0.12, 0.20, 0.05], mass = 5.0 }
wires = { count = 2, l = 0.5, t1 = 0.05, t2 = 0.1, d = 0.002, k = 3e4 }
blades = { count = 2, stiffness = 1500.0, tip_mass = 0.1, lateral_stiffness = [3e5, 2e5] }
[[stage]]
name = "mid"
body = { mass = 6.0, inertia = [0.03, 0.02, 0.06] }
wires = { count = 4, l = 0.3, s = 0.03, t1 = 0.04, t2 = 0.1, d = 0.001, d_upper = 0.003, k = 2e4 }
blades = { count = 2, geometry = { length = 0.1, base_width = 0.02, thickness = 0.002, shape_factor = 1.5, material = "maraging" } }
[[stage.spring]]
stiffness = [10.0, 20.0, 30.0, 0.1, 0.2, 0.3]
at = [0.01, 0.02, 0.03]
[[stage]]
name = "test"
body = { shape = "cylinder", axis = "x", radius = 0.09, length = 0.1, mass = 5.6 }
wires = { count = 4, l = 0.28, s_upper = 0.01, s_lower = 0.005, t1 = 0.0965, t2 = 0.0965, d = 0.001, d_upper = 0.001, k = 1e4 }
"""

FIVE = """
[design]
name = "five"
[[stage]]
name = "test"
position = [0.0, 0.0, -0.4]
body = { shape = "box", size = [0.16, 0.24, 0.1], mass = 10.0 }
""" + "".join(
    f"[[stage.wire]]\nupper = [{x}, {y}, {0.03 - z}]\nlower = [{x}, {y}, {z}]\nk = 2e4\n"
    for x, y, z in [
        (0.06, 0.11, 0.02),
        (0.06, -0.11, 0.02),
        (-0.06, 0.11, 0.02),
        (-0.07, -0.11, 0.02),
        (0.02, 0.01, 0.05),
    ]
)

TREE = """
[design]
name = "tree"
[[stage]]
name = "top"
body = { shape = "box", size = [0.15, 0.30, 0.06], mass = 12.0 }
wires = { count = 2, l = 0.35, t1 = 0.08, t2 = 0.08, d = 0.002, k = 5e4 }
[[stage]]
name = "mirror-with-a-name-that-is-longer-than-anyone-would-want"
body = { shape = "cylinder", radius = 0.11, length = 0.10, mass = 10.6 }
wires = { count = 4, l = 0.30, s = 0.005, t1 = 0.11, t2 = 0.11, d = 0.001, k = 5e4 }
[[stage]]
name = "recoil"
hangs_from = "top"
body = { shape = "cylinder", radius = 0.16, inner_radius = 0.13, length = 0.14, mass = 12.0 }
wires = { count = 4, l = 0.30, s = 0.05, t1 = 0.14, t2 = 0.15, d = 0.002, k = 5e4 }
"""

CHAIN = '[design]\nname = "chain"\n' + "".join(
    f'[[stage]]\nname = "m{n}"\nbody = {{ shape = "box", size = [0.12, 0.2, 0.06], mass = 4.0'
    " }\nwires = { count = 4, l = 0.28, s = 0.02, t1 = 0.08, t2 = 0.08, d = 0.001, d_upper ="
    " 0.001, k = 4e4 }\n"
    for n in range(1, 9)
)

DESIGNS = {"single": SINGLE, "triple": TRIPLE, "five": FIVE, "tree": TREE, "chain": CHAIN}


def made(text):
    design = reader.parse(text)
    return design, expand(design)


def solved(text):
    design, scene = made(text)
    return design, scene, analysis.solve(registry.STRING.system(design))
