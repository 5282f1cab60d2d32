"""Choose numbers of a design so that it meets goals."""
