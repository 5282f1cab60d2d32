"""Compute the motion of the mirror by cause: ground, sensors, actuators, thermal noise."""
