"""Inputs and outputs of the inference: priors, prior of the pose, hypotheses, status and findings."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
