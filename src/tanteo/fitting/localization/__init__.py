"""Pose of a part from pairings of sensed with model features: estimate, covariance, unobserved directions."""
