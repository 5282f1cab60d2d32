"""Draw a design to scale, from the side and from the front."""
