"""Statics, limits of validity and plausibility of designs."""
