"""Read many CAD files in parallel, cache the parts, and store them as a catalogue on disk."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.catalogue.building import Built, add_to_catalogue, build_catalogue
    from tanteo.catalogue.cache import cache_folder
    from tanteo.catalogue.from_memory import part_from_mesh
    from tanteo.catalogue.opened import Catalogue, open_catalogue
    from tanteo.catalogue.reading import Failure, Parts, read_parts
    from tanteo.catalogue.resting import Rest, hull_points, known_rests, rest_rows, rests
    from tanteo.catalogue.segment import tables_of
    from tanteo.catalogue.shaping import SAMPLES, SHAPE, compiled_shape
    from tanteo.catalogue.signatures import AXES, LEVELS, coarse_field, faces_of, field_table, signature, widths
    from tanteo.catalogue.store import is_catalogue
    from tanteo.catalogue.surprises import cad_files, coarse_meshes, repaired, skipped_folders, unused_unit

__all__ = [
    "AXES",
    "LEVELS",
    "SAMPLES",
    "SHAPE",
    "Built",
    "Catalogue",
    "Failure",
    "Parts",
    "Rest",
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
    "known_rests",
    "open_catalogue",
    "part_from_mesh",
    "read_parts",
    "repaired",
    "rest_rows",
    "rests",
    "signature",
    "skipped_folders",
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
        "resting": "Rest hull_points known_rests rest_rows rests",
        "segment": "tables_of",
        "shaping": "SAMPLES SHAPE compiled_shape",
        "signatures": "AXES LEVELS coarse_field faces_of field_table signature widths",
        "store": "is_catalogue",
        "surprises": "cad_files coarse_meshes repaired skipped_folders unused_unit",
    },
)
