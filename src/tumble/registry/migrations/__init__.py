"""How a registry of an earlier version becomes one of this: a file a version, in `versions`."""
