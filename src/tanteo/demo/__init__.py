"""The story of ``tanteo demo``: an image leaves two parts, a beam tells them apart, a few more place the one it is."""

from tanteo.demo.story import Told, tell

__all__ = ["Told", "tell"]
