"""One script for each make target that writes results or documentation."""
