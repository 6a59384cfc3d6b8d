"""A settled adjustment as an estimate: parameters by name, their budget and distributions, words about it."""
