"""Savage (2018): the strapdown rotation test."""
