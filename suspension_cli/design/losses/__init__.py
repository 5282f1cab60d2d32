"""Mechanisms of loss in materials, one file each: keys of the design file and loss angles."""
