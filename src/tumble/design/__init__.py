"""What a test will tell, before anything is recorded: sensitivities of poses, better sets, error budgets.

It stands above `calibration`, whose refusals in words it shares, and draws nothing.
"""
