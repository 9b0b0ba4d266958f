"""Many parts: read in parallel, survive what crashes or never ends, remember what was read."""

from tanteo.catalogue.reading import Failure, Parts, read_parts

__all__ = ["Failure", "Parts", "read_parts"]
