"""Measured transfer functions: files of data, and how they relate to signals of a design."""
