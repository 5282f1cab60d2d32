"""Compute modes, responses and couplings over grids of parameters."""
