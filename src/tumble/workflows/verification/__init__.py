"""A calibration judged by what it corrects: holds, turns, and drives with satellite positions."""
