"""Analyses, one folder each: physics and result type, HDF5 group, picture, command."""
