"""A recording corrected by a calibration: its form, its field, the instants of its samples, its temperature."""
