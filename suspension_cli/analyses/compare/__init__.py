"""Compare designs, results and measurements."""
