# %% [markdown]
# Thermal noise of a quadruple by pendsus and by pygwinc, with the fibres and losses of aLIGO.
# %%
import gwinc
import numpy as np

import suspension_cli as sus

end = {"length": 0.045, "radius": 400e-6}
fibres = {"count": 4, "l": 0.58562, "s": 0.015, "t1": 0.17025, "t2": 0.17025, "k": 18150.0}
fibres |= {"d": 0.00855, "d_upper": 0.00783, "clamp": "bending-point"}
fibres |= {"material": "fused-silica", "sections": [end, {"radius": 205e-6}, end]}
changes = {"stage.test.wires": fibres}
for stage, thickness in {"top": 4.3e-3, "upper": 4.6e-3, "penultimate": 4.2e-3}.items():
    changes[f"stage.{stage}.wires.material"] = "c70steel"
    changes[f"stage.{stage}.blades.material"] = "maraging"
    changes[f"stage.{stage}.blades.thickness"] = thickness
quadruple = sus.example("ligo-quad").replace(changes)

frequency = np.array([15.0, 20.0, 30.0, 50.0, 100.0])
budget = sus.gwinc(sus.export(quadruple, format="gwinc", band="10:110"), frequency)
ours, theirs = budget.run(), gwinc.load_budget("aLIGO", freq=frequency).run()
ratio = ours["SuspensionThermal"].asd / theirs["SuspensionThermal"].asd
print("suspension thermal noise, pendsus / gwinc - 1:", *(f"{100 * r:+.1f} %" for r in ratio - 1))
