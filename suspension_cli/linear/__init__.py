"""Linear system of small motions: symmetry, eigenmodes, responses, state space."""
