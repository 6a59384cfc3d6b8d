"""What the program computes today, pinned: see README.md beside this file."""
