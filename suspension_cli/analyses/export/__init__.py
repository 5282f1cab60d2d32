"""Export state space for control tools and finesse, noise for gwinc."""
