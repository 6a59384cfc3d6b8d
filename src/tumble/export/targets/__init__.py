"""Targets, one file each: how another tool writes a calibration or a unit's noise, and how it is read back.

A module of this room has its record as `TARGET`; that makes it known to `tumble convert` and to the contract that every
target is held to.
"""
