"""Compute the scatter of modes and cross-coupling over random builds, and its causes."""
