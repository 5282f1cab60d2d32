"""Benchmarks: times of the program relative to a floor measured in the same run (`make bench`)."""
