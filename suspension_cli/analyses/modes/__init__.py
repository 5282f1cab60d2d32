"""Compute the normal modes: frequencies, shapes, Q."""
