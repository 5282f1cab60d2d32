# %% [markdown]
# Optical spring of an arm cavity between two quadruple pendulums: `[[cavity]]` and finesse 3.
# %%
import re

import finesse
import matplotlib.pyplot as plt
import numpy as np
from finesse.analysis.actions import FrequencyResponse

import suspension_cli as sus

length, lost, power = 3994.5, 0.014, 20.0  # m; per round trip; W of the laser
quadruple = sus.example("quadruple")
suspension = sus.export(quadruple, format="finesse")  # without losses, off resonance

# %% Both quadruples in one design: their stages under other names, each chain on the support
text, stages = '[design]\nname = "arm"\n', quadruple.text[quadruple.text.index("[[stage]]") :]
for mirror in ("itm", "etm"):
    chain = re.sub(r'name = "(\w+)"', rf'name = "{mirror}-\1"', stages)
    text += chain.replace('-top"\n', '-top"\nhangs_from = "support"\n', 1)
text += f"""
[[cavity]]
name = "arm"
between = ["itm-test", "etm-test"]
length = {length}
radii = [1934.0, 2245.0]
transmission = {lost}
power = 0.0
"""
# %% The force between the mirrors and the length of the arm, by pendsus (lines) and finesse (dots)
lines = np.geomspace(0.1, 100, 508)  # every 13th by finesse, too
push, motion = ["itm.mech.F_z", "etm.mech.F_z"], ["itm.mech.z", "etm.mech.z"]
for detuning in (0.0, 0.5, 2.0, 10.0):  # Hz
    model = finesse.Model()
    model.fsig.f = 1
    model.parse(f"""
        l laser P={power}
        s before laser.p1 itm.p1
        m itm R={1 - lost} T={lost}
        s space itm.p2 etm.p1 L={length}
        m etm R=1 T=0 phi={-360 * detuning * length / 299792458}
        pd inside etm.p1.i
    """)
    for name in ("itm", "etm"):
        model.add(sus.finesse(suspension, f"sus_{name}", getattr(model, name), facing=-1))
    light = {"cavity.arm.power": float(model.run()["inside"]), "cavity.arm.detuning": detuning}
    signals = {"inputs": "etm-test~itm-test.force_x", "outputs": "etm-test~itm-test.x"}
    design = sus.parse(text).replace(light)  # anti-damped, hence unstable
    found = sus.response(design, **signals, frequency=lines, fidelity="beam", allow_unstable=True)
    ours = abs(found.value[:, 0, 0])
    [line] = plt.loglog(lines, ours, label=f"detuned by {detuning:g} Hz")
    solved = model.run(FrequencyResponse(lines[::13], push, motion))
    ways = [(i == o) - (i != o) for i in range(2) for o in range(2)]
    moved = abs(np.tensordot(ways, [solved[o, i] for i in push for o in motion], 1))
    plt.loglog(lines[::13], moved, ".", color=line.get_color())
    print(f"{detuning:4g} Hz: {np.interp(10, lines, ours):.3g} m/N at 10 Hz")
plt.gca().set(xlabel="frequency (Hz)", ylabel="length of the arm over force (m/N)")
plt.legend(title="lines: pendsus, dots: finesse")
plt.savefig("cavity.png", dpi=120)
