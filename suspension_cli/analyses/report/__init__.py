"""Write one HTML file of a design with all its analyses."""
