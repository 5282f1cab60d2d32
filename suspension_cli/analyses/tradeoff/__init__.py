"""Measure speed and accuracy of every model and method."""
