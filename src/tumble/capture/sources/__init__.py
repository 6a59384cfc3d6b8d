"""Where samples come from: a file each, with a record `SOURCE` (or several, `SOURCES`) that is found here."""
