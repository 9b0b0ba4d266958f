"""The story of ``tanteo demo``: an image leaves two parts, a beam discriminates them, a few more place it."""

from tanteo.demo.story import Observation, tell

__all__ = ["Observation", "tell"]
