"""Many units calibrated alike: where they are found, one unit, all of them, and who does the work."""
