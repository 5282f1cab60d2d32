"""Compute thermal noise of any motion, split by cause."""
