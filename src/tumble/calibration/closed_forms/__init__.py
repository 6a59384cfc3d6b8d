"""The papers' own closed forms and iterations, by name: starts of the adjustments, and for comparison."""
