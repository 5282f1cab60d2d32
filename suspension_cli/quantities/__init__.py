"""Scalar results of designs by name, for every analysis: `vocabulary.parse` and `solved.Solved`."""
