"""Fit numbers of designs to measured mode frequencies."""
