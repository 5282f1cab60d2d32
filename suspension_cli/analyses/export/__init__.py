"""Export state space for control tools, finesse and Foton; noise for gwinc."""
