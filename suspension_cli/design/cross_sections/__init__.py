"""Cross-sections of wires, one per file: stiffness, inertia, loss and drag that follow from it."""
