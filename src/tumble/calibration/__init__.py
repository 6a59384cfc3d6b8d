"""Procedures: ways to estimate the sensor model from a recorded protocol.

One file a procedure; each builds conditions for `tumble.estimation` and writes no solver of its own.
"""
