"""Speed against accuracy: what every rung and every method costs for one design, and what it gets wrong.

`comparisons` lists what is compared; `run.measured` compares.
"""
