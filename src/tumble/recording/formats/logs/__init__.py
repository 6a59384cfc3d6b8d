"""Logs of flight controllers and phones: streams of sensors with clocks of their own, put on one time base."""
