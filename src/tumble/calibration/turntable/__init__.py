"""The steps of the turntable procedure: its task, its solution, the estimate of it and the words."""
