"""The command line: one module a command, each asking `tumble.workflows` and printing what it says."""
