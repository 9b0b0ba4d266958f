"""Modes of the posterior and importance sampling about them."""
