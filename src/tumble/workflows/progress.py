"""What is told while work is going on, where nobody asked."""


def silent(_: str) -> None:
    """Tell nobody."""
