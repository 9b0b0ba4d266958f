"""A scene file, played: what its camera sees, where a session starts, and the simulated hand that senses in it.

Here the simulator meets the session. What senses gets no more than a robot would: the truth stays in the scene::

    scene = read_scene("scene.toml")
    start, _ = start_of(scene, parts)
    session, robot, rules = session_of(scene, start, Stop(tolerance=1e-3))
    done = sense_part(session, robot, rules, furniture=furniture_of(scene), errors=scene.cell.robot)
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.scenes.acquiring import acquire, change_scene, expected_feature, least_clearance
    from tanteo.scenes.sessions import furniture_of, prior_start, session_of, start_of
    from tanteo.scenes.view import RENDER, SceneView, place_camera, view_of

__all__ = [
    "RENDER",
    "SceneView",
    "acquire",
    "change_scene",
    "expected_feature",
    "furniture_of",
    "least_clearance",
    "place_camera",
    "prior_start",
    "session_of",
    "start_of",
    "view_of",
]

__getattr__: Callable[[str], Any]
__dir__: Callable[[], list[str]]
__getattr__, __dir__ = lazy(
    __name__,
    {
        "acquiring": "acquire change_scene expected_feature least_clearance",
        "sessions": "furniture_of prior_start session_of start_of",
        "view": "RENDER SceneView place_camera view_of",
    },
)
