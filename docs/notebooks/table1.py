# %% [markdown]
# Table I of Husman et al. (2000): modes of a single pendulum on four wires, in four geometries.
# %%
import tomllib
from pathlib import Path

import suspension_cli as sus

paper = tomllib.loads((Path(__file__).parents[2] / "tools" / "paper.toml").read_text())["table1"]
dof = {"longitudinal": "x", "sideways": "y", "vertical": "z"}
dof |= {"roll": "roll", "tilt": "pitch", "rotation": "yaw"}

# %% One row per mode: the paper's theory, the force model, and their difference
print("case  mode          paper (Hz)  model (Hz)  difference")
for case in paper["case"]:
    design = sus.example(f"husman2000/table1-case{case['case']}")
    found = sus.modes(design, fidelity="force")
    for word, theory in zip(paper["columns"], case["theory"], strict=True):
        [frequency] = found.of(dof[word])
        change = frequency / theory - 1
        print(f"{case['case']:4}  {word:12} {theory:11.4g} {frequency:11.4g} {100 * change:9.2f} %")
