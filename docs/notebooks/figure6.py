# %% [markdown]
# Figure 6 of Husman et al. (2000): cross-coupling at 50 Hz of a stage with one imperfect wire.
# %%
import matplotlib.pyplot as plt
import numpy as np

import suspension_cli as sus

design = sus.example("husman2000/figure6")
found = sus.xcouple(
    design,
    sweep={"k": "0.6:1.4:41", "offset": "-2e-3:2e-3:5"},  # stiffness, upper end of wire 1 (m)
    wire="test.1",
    observe="test@0,0,-0.001",  # 1 mm below the centre of mass
    frequency=50.0,
    fidelity="string",
)

# %% One line per offset of the upper end
k, offset = (np.array(axis.values) for axis in found.axes)
ratio = np.abs(found.ratio[..., 0])
plt.plot(k, ratio, label=[f"{1e3 * value:+.0f} mm" for value in offset])
plt.xlabel("$k/k_0$")
plt.ylabel("horizontal to vertical ratio")
plt.legend(title="offset of the upper end")
print(f"largest ratio: {ratio.max():.3e}")
