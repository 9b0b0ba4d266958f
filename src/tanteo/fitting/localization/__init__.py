"""Pairings of sensed with model features -> the part's pose, its covariance, and what stays unobserved."""
