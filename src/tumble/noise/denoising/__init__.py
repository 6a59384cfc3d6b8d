"""Noise taken out of a recording: by shrinking wavelets, or by a filter of the level and its autoregression."""
