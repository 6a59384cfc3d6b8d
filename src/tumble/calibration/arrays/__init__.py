"""Units that move together on one fixture."""
