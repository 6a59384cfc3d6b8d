"""Planning a test before it is done: poses, rotations, any protocol."""
