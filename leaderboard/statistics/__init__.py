"""How surely a number is known: intervals over seeds and over routes."""
