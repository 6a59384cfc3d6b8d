"""Procedures, one file each: what is known about the motion, and how the sensor model is estimated from it."""
