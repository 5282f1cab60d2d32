"""Compute random builds: scatter of modes and cross-coupling, and its causes."""
