"""Modes of the posterior, and importance sampling of them."""
