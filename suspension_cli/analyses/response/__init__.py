"""Compute transfer functions from the support or a force to any motion."""
