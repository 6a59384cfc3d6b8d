"""A change of the tables a file; they are never edited once released."""
