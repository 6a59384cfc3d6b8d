"""Which poses tell what, before anything is recorded: sensitivities, expected uncertainties, better sets.

It stands above `calibration`, whose refusals in words it shares, and draws nothing.
"""
