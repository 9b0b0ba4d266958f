"""Image -> what lies there: part, pose with covariance, and what the camera cannot tell.

``see_table`` for things on a table that the camera knows, ``see_anywhere`` for one part in any pose, ``follow`` from
image to image; ``image_edge``, ``image_corner`` and ``image_circle`` make what a camera sees of one edge, corner or rim
a feature for ``localization``. Needs OpenCV (the extra ``vision``), imported when the first image comes.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.vision.answers import Question
    from tanteo.vision.camera import (
        DISTORTION_COUNTS,
        PIXELS,
        USUAL_EDGE_SD,
        Camera,
        on_plane,
        opencv,
        project,
        rays,
        rigid,
        without_distortion,
    )
    from tanteo.vision.circles import CirclePose, circle_poses, project_circle
    from tanteo.vision.descriptors import DESCRIPTOR_NAMES, Descriptors, describe
    from tanteo.vision.edges import EdgeMap, EdgePoints, find_edges, map_edges
    from tanteo.vision.ellipse_fit import Ellipse, fit_ellipse
    from tanteo.vision.ellipses import Ellipses, find_ellipses
    from tanteo.vision.features import image_centre, image_circle, image_corner, image_edge
    from tanteo.vision.image_edges import ImageEdges, Weights, chance_map
    from tanteo.vision.models import VisionModel, prepare_vision
    from tanteo.vision.outlines import Narrowed, OutlineOfReadings, narrowed, outline_of_readings, seen_outline
    from tanteo.vision.picture import draw_sight
    from tanteo.vision.regions import Region, find_regions, silhouette
    from tanteo.vision.rendering import Look, Stage, Thing, render, thing
    from tanteo.vision.segments import Corners, Segments, find_corners, find_segments
    from tanteo.vision.sight import Sight, Sighting, see_table
    from tanteo.vision.solid import follow, see, see_anywhere
    from tanteo.vision.table import CameraPose, TableErrors, fit_camera
    from tanteo.vision.views import View, view_factors

__all__ = [
    "DESCRIPTOR_NAMES", "DISTORTION_COUNTS", "PIXELS", "USUAL_EDGE_SD", "Camera", "CameraPose", "CirclePose",
    "Corners", "Descriptors", "EdgeMap", "EdgePoints", "Ellipse", "Ellipses", "ImageEdges", "Look", "Narrowed",
    "OutlineOfReadings", "Question", "Region", "Segments", "Sight", "Sighting", "Stage", "TableErrors", "Thing",
    "View", "VisionModel", "Weights", "chance_map", "circle_poses", "describe", "draw_sight", "find_corners",
    "find_edges", "find_ellipses", "find_regions", "find_segments", "fit_camera", "fit_ellipse", "follow",
    "image_centre", "image_circle", "image_corner", "image_edge", "map_edges", "narrowed", "on_plane", "opencv",
    "outline_of_readings", "prepare_vision", "project", "project_circle", "rays", "render", "rigid", "see",
    "see_anywhere", "see_table", "seen_outline", "silhouette", "thing", "view_factors", "without_distortion",
]  # fmt: skip

__getattr__: Callable[[str], Any]
__dir__: Callable[[], list[str]]
__getattr__, __dir__ = lazy(
    __name__,
    {
        "answers": "Question",
        "camera": "DISTORTION_COUNTS PIXELS USUAL_EDGE_SD Camera on_plane opencv project rays rigid without_distortion",
        "circles": "CirclePose circle_poses project_circle",
        "descriptors": "DESCRIPTOR_NAMES Descriptors describe",
        "edges": "EdgeMap EdgePoints find_edges map_edges",
        "ellipse_fit": "Ellipse fit_ellipse",
        "ellipses": "Ellipses find_ellipses",
        "features": "image_centre image_circle image_corner image_edge",
        "image_edges": "ImageEdges Weights chance_map",
        "models": "VisionModel prepare_vision",
        "outlines": "Narrowed OutlineOfReadings narrowed outline_of_readings seen_outline",
        "picture": "draw_sight",
        "regions": "Region find_regions silhouette",
        "rendering": "Look Stage Thing render thing",
        "segments": "Corners Segments find_corners find_segments",
        "sight": "Sight Sighting see_table",
        "solid": "follow see see_anywhere",
        "table": "CameraPose TableErrors fit_camera",
        "views": "View view_factors",
    },
)
