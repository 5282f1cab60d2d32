"""The rows of the stability atlas, the methods that fail in them, and their references."""
