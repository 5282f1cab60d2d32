"""Compute the effect of 1 mm, 1 mrad or 1 % of every number of a design."""
