"""Check a design, and list what its wires carry."""
