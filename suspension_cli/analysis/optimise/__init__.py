"""Numbers of a design chosen so that it meets goals: `run` searches and checks; docs/optimise.md says how."""
