"""The equations of holds, turns, spins and believed poses, as arrays with their derivatives."""
