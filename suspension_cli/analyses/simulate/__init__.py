"""Run the closed loops of a design in time, with noise, steps and limits of coils."""
