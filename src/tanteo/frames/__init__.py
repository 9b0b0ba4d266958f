"""Uncertain frames: what is known of where a frame is, and how well."""

from tanteo.frames.covariances import check_covariance, check_covariances, frozen_array

__all__ = ["check_covariance", "check_covariances", "frozen_array"]
