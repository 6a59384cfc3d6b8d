"""What lines and ports send: a file for each format, with a record `FORMAT` that is found here."""
