"""Cameras, images, poses and priors as text and files."""
