"""Valid designs for the tests of the command to spoil."""

from __future__ import annotations

import tomllib
from typing import Any

from suspension_cli.design import paths
from suspension_cli.design.reader import parse_with_overrides, template
from tests.support.commandline import KINDS


def overridden(text, values):
    """A design with numbers replaced at dotted paths, by itself."""
    return parse_with_overrides(text, paths.settings(values))


TEXTS = {kind: template(kind, kind) for kind in KINDS}
"""The templates as TOML text."""

TEXTS["rich"] = """\
[design]
name = "rich"
title = "A tree with everything in it"
reference = "none"

[constants]
gravity = 9.8
temperature = 300.0

[support]
stiffness = { x = 2e6, z = 1e7, pitch = 1e5 }
mass = 300.0
inertia = [20.0, 20.0, 30.0]
damping = { x = 10.0 }
loss_angle = 1e-3

[[control.loop]]
name = "swing"
sensor = "upper.x"
actuator = "upper.force_x"
damper = 5.0
sensor_noise = 1e-10

[[control.loop]]
name = "turn"
sensor = "upper.yaw"
actuator = "upper.torque_yaw"
reference = "inertial"
gain = 2.0
zeros = [0.1]
poles = [10.0, [3.0, 4.0]]

[materials.wire]
youngs_modulus = 2.0e11
poisson_ratio = 0.3
density = 7800.0
loss_angle = 1e-4

[materials.steel302]
density = 7950.0

[[stage]]
name = "upper"
position = [0.0, 0.0, -0.4]
body = { mass = 6.0, inertia = [[0.03, 0.001, 0.0], [0.001, 0.02, 0.0], [0.0, 0.0, 0.04]] }

[[stage.wire]]
upper = [0.01, 0.1, 0.0]
lower = [0.01, 0.1, 0.003]
material = "wire"
radius = 2e-4
blade = "left"

[[stage.wire]]
upper = [0.0, -0.1, 0.0]
lower = [0.0, -0.1, 0.003]
k = 3.0e4
tension = 84.0
blade = "right"

[[stage.wire]]
upper = [-0.01, 0.1, 0.0]
lower = [-0.01, 0.1, 0.003]
material = "steel302"
section = { width = 4e-4, thickness = 1e-4 }
natural_length = 0.402

[[stage.blade]]
name = "left"
at = [0.01, 0.1, 0.0]
stiffness = 2.0e3
tip_mass = 0.02
lateral_stiffness = [1e5, 2e5]
loss_angle = 1e-4

[[stage.blade]]
name = "right"
uncoupled_frequency = 3.0

[[stage.spring]]
stiffness = [10.0, 10.0, 5.0, 0.1, 0.1, 0.2]
damping = [0.1, 0.1, 0.1, 0.0, 0.0, 0.0]
preload = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
at = [0.0, 0.0, 0.01]
loss_angle = 1e-3

[stage.damping]
x = 0.1
yaw = 0.01
against = "support"

[[stage]]
name = "test"
hangs_from = "upper"
body = { shape = "cylinder", axis = "x", radius = 0.09, inner_radius = 0.01, length = 0.1, density = 2200.0 }

[stage.wires]
count = 4
l = 0.28
s_upper = 0.01
s_lower = 0.012
t1 = 0.08
t2 = 0.095
d = 0.001
d_upper = 0.002
material = "fused-silica"
radius = 2e-4

[stage.blades]
count = 2
geometry = { length = 0.2, base_width = 0.04, thickness = 0.002, shape_factor = 1.35, material = "maraging" }

[[stage]]
name = "reaction"
hangs_from = "upper"
body = { shape = "box", size = [0.1, 0.2, 0.3], mass = 5.0 }

[stage.wires]
count = 2
l = 0.3
t1 = 0.12
t2 = 0.12
d = 0.002
k = 2.0e4

[[perturbation]]
wire = "test.1"
k_factor = 1.1
upper_offset = [0.001, 0.0, 0.0]
lower_offset = [0.0, 0.001, 0.0]
length_change = 1e-6
hold = "natural-length"

[[perturbation]]
body = "test"
com_offset = [0.0001, 0.0, 0.0]
rotation = [0.001, 0.0, 0.0]

[analysis.modes]
fidelity = "string"
plot = false

[analysis.xcouple]
wire = "test.1"
frequency = 50.0
"""

TEXTS["fibres"] = """\
[design]
name = "fibres"

[gas]
pressure = 1e-6
molar_mass = 0.002
temperature = 295.0

[materials.glass]
youngs_modulus = 7.2e10
poisson_ratio = 0.17
density = 2200.0
thermal_expansion = 3.9e-7
modulus_slope = 1.52e-4
specific_heat = 772.0
thermal_conductivity = 1.38

[materials.glass.loss]
table = { frequency = [1.0, 100.0], angle = [1e-9, 1e-8] }
surface_depth = 1.5e-2
thermoelastic = true

[materials.c70steel.loss]
angle = 3e-4

[[stage]]
name = "test"
body = { mass = 5.6, inertia = [0.03, 0.02, 0.02] }

[stage.wires]
count = 4
l = 0.28
s = 0.01
t1 = 0.08
t2 = 0.095
d = 0.001
material = "glass"
sections = [
    { length = 0.01, radius = 4e-4 },
    { length = 0.005, radius = [4e-4, 1.25e-4], steps = 4 },
    { radius = 1.25e-4 },
    { length = 0.01, section = { width = 4e-4, thickness = 2e-4 }, material = "c70steel" },
]
clamp = { upper = [0.0, 0.01, -1.0] }
temperature = { upper = 300.0, lower = 290.0 }

[stage.blades]
count = 4
stiffness = 2.0e3
material = "maraging"
thickness = 2e-3
temperature = 293.0

[[stage]]
name = "mass"
position = [0.0, 0.0, -0.3]
body = { mass = 2.0, inertia = [0.01, 0.01, 0.01] }

[[stage.wire]]
upper = [0.0, 0.05, 0.0]
lower = [0.0, 0.05, 0.001]
material = "steel302"
sections = [{ length = 0.1, radius = 1e-4 }, { length = 0.199, radius = 2e-4 }]
clamp = { lower = [0.01, 0.0, -1.0] }
temperature = 280.0

[[stage.wire]]
upper = [0.0, -0.05, 0.0]
lower = [0.0, -0.05, 0.001]
material = "steel302"
radius = 1e-4
"""

RAW: dict[str, dict[str, Any]] = {name: tomllib.loads(text) for name, text in TEXTS.items()}
"""The same, parsed."""
