"""Poses in which suspensions hang, by Newton's method with exact rotations and stiffness."""
