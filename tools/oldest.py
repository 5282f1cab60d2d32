"""Print the oldest libraries that pyproject.toml admits, as constraints for pip.

They are those of the program and of its optional parts. Tools of the tests are new, except those
of which new versions do not run with old libraries. Used by `make test-oldest`.
"""

from __future__ import annotations

import tomllib
from pathlib import Path

EXTRAS = ("cluster", "control", "finesse", "gwinc", "notebook")
"""Optional parts of the program."""
TOOLS = ("check-jsonschema",)
"""Tools of the tests that have to be old: check-jsonschema 0.38 does not run with click 8.2."""

project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]
extras = project["optional-dependencies"]
wanted = [*project["dependencies"]]
for name in EXTRAS:
    wanted += extras[name]
wanted += [one for one in extras["test"] if one.startswith(TOOLS)]
for requirement in dict.fromkeys(wanted):
    print(requirement.replace(">=", "=="))
