"""Inputs and outputs of the inference: priors, prior of the pose, hypotheses, status and findings."""
