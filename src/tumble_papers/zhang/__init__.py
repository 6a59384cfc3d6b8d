"""Zhang et al. (2010): turntable calibration, inter-triad misalignment, the best poses."""
