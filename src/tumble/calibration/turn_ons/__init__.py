"""Several recordings of one unit: what changes from turn-on to turn-on, and what is stable."""
