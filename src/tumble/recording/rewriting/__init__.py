"""Bags written anew with some messages exchanged: every other byte that a reader gets stays what it was."""
