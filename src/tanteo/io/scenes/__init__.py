"""A scene file, played: what its camera sees, where a session starts, and the simulated hand that senses in it.

Here the simulator meets the session. What senses gets no more than a robot would: the truth stays in the scene::

    scene = read_scene("scene.toml")
    start, _ = start_of(scene, parts)
    session, robot, rules = session_of(scene, start, Stop(tolerance=1e-3))
    done = sense_part(session, robot, rules, furniture=furniture_of(scene), errors=scene.cell.robot)
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
