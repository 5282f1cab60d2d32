"""Design files: format, units, checks, overrides, materials; files of measured modes and goals."""
