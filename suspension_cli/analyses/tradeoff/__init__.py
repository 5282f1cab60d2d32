"""Measure speed and accuracy of every model for a design."""
