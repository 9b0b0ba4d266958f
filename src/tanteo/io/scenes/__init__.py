"""Simulation of a scene file: camera image, start of a session, and simulated hand.

This package connects the simulator with a session. The session gets only data that a real robot has; the true poses
stay in the scene::

    scene = read_scene("scene.toml")
    start, _ = start_of(scene, parts)
    session, robot, rules = session_of(scene, start, Stop(tolerance=1e-3))
    done = sense_part(session, robot, rules, furniture=furniture_of(scene), errors=scene.cell.robot)
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
