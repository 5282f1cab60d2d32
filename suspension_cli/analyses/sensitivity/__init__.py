"""Compute the effect of 1 % of every number of a design."""
