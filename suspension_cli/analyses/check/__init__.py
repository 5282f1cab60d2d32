"""Statics, limits of validity and plausibility of designs, for `pendsus check` and warnings."""
