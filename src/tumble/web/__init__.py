"""The page of a guided capture: a server for browsers on this machine, and what they show."""
