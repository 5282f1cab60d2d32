"""Compute the errors of all models of a design, and which one it needs."""
