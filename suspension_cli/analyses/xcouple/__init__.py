"""Compute the cross-coupling of imperfect builds."""
