"""Files and messages: readings, poses, cameras, results, session records and logs of other programs."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
