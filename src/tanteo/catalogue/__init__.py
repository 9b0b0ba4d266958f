"""Many parts: read in parallel, survive what crashes or never ends, remember what was read."""

from tanteo.catalogue.cache import cache_folder
from tanteo.catalogue.reading import Failure, Parts, read_parts

__all__ = ["Failure", "Parts", "cache_folder", "read_parts"]
