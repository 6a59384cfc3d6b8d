"""Several recordings, turn-ons or units that are calibrated together."""
