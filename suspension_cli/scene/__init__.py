"""Scenes: bodies, wires, blades and springs of a design as arrays; imperfections; tensions."""
