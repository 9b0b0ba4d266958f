"""The story of ``tanteo demo``: an image leaves two parts, a beam discriminates them, a few more place it."""

from tanteo.demo.stage import Seen, Stage, set_stage
from tanteo.demo.story import NEEDED, Needed, Observation, needed, tell, try_it

__all__ = ["NEEDED", "Needed", "Observation", "Seen", "Stage", "needed", "set_stage", "tell", "try_it"]
