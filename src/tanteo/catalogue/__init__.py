"""Many parts: read in parallel, survive what crashes or never ends, remember what was read."""

from tanteo.catalogue.cache import cache_folder
from tanteo.catalogue.reading import Failure, Parts, read_parts
from tanteo.catalogue.surprises import cad_files, coarse_meshes, repaired, skipped_folders, unused_unit

__all__ = [
    "Failure",
    "Parts",
    "cache_folder",
    "cad_files",
    "coarse_meshes",
    "read_parts",
    "repaired",
    "skipped_folders",
    "unused_unit",
]
