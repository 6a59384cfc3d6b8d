"""Other ways to write the same matrices down: one file a convention, exact both ways.

Every function is analytic and takes arrays, so that `tumble.sensor.propagate` carries a covariance
through it.
"""
