"""Read many CAD files in parallel, cache the parts, and store them as a catalogue on disk."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.catalogue.building import Built, add_to_catalogue, build_catalogue
    from tanteo.catalogue.cache import cache_folder
    from tanteo.catalogue.file_warnings import cad_files, coarse_meshes, repaired, skipped_folders, unused_unit
    from tanteo.catalogue.from_memory import part_from_mesh
    from tanteo.catalogue.opened import Catalogue, open_catalogue
    from tanteo.catalogue.reading import Failure, Parts, read_parts
    from tanteo.catalogue.segment import tables_of
    from tanteo.catalogue.shaping import SAMPLES, SHAPE, compiled_shape
    from tanteo.catalogue.signatures import AXES, LEVELS, coarse_field, faces_of, field_table, signature, widths
    from tanteo.catalogue.stability import (
        StablePose,
        hull_points,
        known_stable_poses,
        stable_pose_rows,
        stable_poses,
    )
    from tanteo.catalogue.store import is_catalogue

__all__ = [
    "AXES",
    "LEVELS",
    "SAMPLES",
    "SHAPE",
    "Built",
    "Catalogue",
    "Failure",
    "Parts",
    "StablePose",
    "add_to_catalogue",
    "build_catalogue",
    "cache_folder",
    "cad_files",
    "coarse_field",
    "coarse_meshes",
    "compiled_shape",
    "faces_of",
    "field_table",
    "hull_points",
    "is_catalogue",
    "known_stable_poses",
    "open_catalogue",
    "part_from_mesh",
    "read_parts",
    "repaired",
    "signature",
    "skipped_folders",
    "stable_pose_rows",
    "stable_poses",
    "tables_of",
    "unused_unit",
    "widths",
]

__getattr__: Callable[[str], Any]
__dir__: Callable[[], list[str]]
__getattr__, __dir__ = lazy(
    __name__,
    {
        "building": "Built add_to_catalogue build_catalogue",
        "cache": "cache_folder",
        "from_memory": "part_from_mesh",
        "opened": "Catalogue open_catalogue",
        "reading": "Failure Parts read_parts",
        "stability": "StablePose hull_points known_stable_poses stable_pose_rows stable_poses",
        "segment": "tables_of",
        "shaping": "SAMPLES SHAPE compiled_shape",
        "signatures": "AXES LEVELS coarse_field faces_of field_table signature widths",
        "store": "is_catalogue",
        "file_warnings": "cad_files coarse_meshes repaired skipped_folders unused_unit",
    },
)
