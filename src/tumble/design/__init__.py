"""What a test will tell, before anything is recorded: of any protocol, and which poses tell most.

It stands above `calibration`, whose refusals in words it shares, and draws nothing.
"""
