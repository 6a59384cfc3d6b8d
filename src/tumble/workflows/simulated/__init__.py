"""What was true of a simulated unit: its document, its files, and whether a calibration recovers it."""
