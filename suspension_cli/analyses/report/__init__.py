"""Report of a design: one HTML file with its drawing and the results of its analyses."""
