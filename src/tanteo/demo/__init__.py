"""The story of ``tanteo demo``: an image leaves two parts, a beam tells them apart, a few more place the one it is."""

from tanteo.demo.story import Observation, tell

__all__ = ["Observation", "tell"]
