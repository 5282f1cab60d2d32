"""Fit numbers of designs to measured mode frequencies and transfer functions."""
