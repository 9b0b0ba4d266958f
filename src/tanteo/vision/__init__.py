"""Image -> what lies there: part, pose with covariance, and what the camera cannot tell.

``see_table`` for things on a table that the camera knows, ``see_anywhere`` for one part in any pose, ``follow`` from
image to image; ``image_edge`` and ``image_corner`` make what a camera sees of a single edge or corner a feature for
``localization``. Needs OpenCV (the extra ``vision``), imported when the first image comes.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.vision.camera import COEFFICIENTS, USUAL, Camera, on_plane, project, rays, without_distortion
    from tanteo.vision.cv import opencv
    from tanteo.vision.descriptors import NAMES, Descriptors, describe
    from tanteo.vision.edge_map import EdgeMap, map_edges
    from tanteo.vision.edges import EdgePoints, find_edges
    from tanteo.vision.features import image_corner, image_edge
    from tanteo.vision.models import VisionModel, prepare_vision
    from tanteo.vision.outlines import like_outline
    from tanteo.vision.picture import draw_sight
    from tanteo.vision.question import Question
    from tanteo.vision.regions import Region, find_regions
    from tanteo.vision.rendering import Look, Stage, Thing, render, thing
    from tanteo.vision.resting import Rest, rests
    from tanteo.vision.seeing import see
    from tanteo.vision.segments import Corners, Segments, find_corners, find_segments
    from tanteo.vision.sight import Sight, Sighting, see_table
    from tanteo.vision.silhouettes import silhouette
    from tanteo.vision.solid import follow, see_anywhere
    from tanteo.vision.table import CameraPose, TableErrors, fit_camera

__all__ = [
    "COEFFICIENTS",
    "NAMES",
    "USUAL",
    "Camera",
    "CameraPose",
    "Corners",
    "Descriptors",
    "EdgeMap",
    "EdgePoints",
    "Look",
    "Question",
    "Region",
    "Rest",
    "Segments",
    "Sight",
    "Sighting",
    "Stage",
    "TableErrors",
    "Thing",
    "VisionModel",
    "describe",
    "draw_sight",
    "find_corners",
    "find_edges",
    "find_regions",
    "find_segments",
    "fit_camera",
    "follow",
    "image_corner",
    "image_edge",
    "like_outline",
    "map_edges",
    "on_plane",
    "opencv",
    "prepare_vision",
    "project",
    "rays",
    "render",
    "rests",
    "see",
    "see_anywhere",
    "see_table",
    "silhouette",
    "thing",
    "without_distortion",
]

__getattr__: Callable[[str], Any]
__dir__: Callable[[], list[str]]
__getattr__, __dir__ = lazy(
    __name__,
    {
        "cv": "opencv",
        "silhouettes": "silhouette",
        "rendering": "Look Stage Thing render thing",
        "camera": "COEFFICIENTS Camera USUAL on_plane project rays without_distortion",
        "descriptors": "Descriptors NAMES describe",
        "edge_map": "EdgeMap map_edges",
        "edges": "EdgePoints find_edges",
        "features": "image_corner image_edge",
        "models": "VisionModel prepare_vision",
        "outlines": "like_outline",
        "picture": "draw_sight",
        "question": "Question",
        "regions": "Region find_regions",
        "resting": "Rest rests",
        "seeing": "see",
        "segments": "Corners Segments find_corners find_segments",
        "sight": "Sight Sighting see_table",
        "solid": "follow see_anywhere",
        "table": "CameraPose TableErrors fit_camera",
    },
)
