"""tanteo: which part is it, where is it, and where to sense next.

The whole path in a few names::

    parts = tanteo.read_parts("parts/")
    readings = tanteo.read_readings("contact_points.csv")
    answer = tanteo.identify(readings, parts, tolerance=0.1e-3)
    print(answer.message, answer.pose, answer.covariance)

Everything is in metres and radians. A pose ``T_world_part`` maps points of the part to the world; its covariance is
6 x 6 over ``x y z rx ry rz`` in the part frame. Names are imported on first use. Packages for those who build on the
mathematics: ``geometry``, ``features``, ``fitting``, ``posterior``.
"""

from lazy_loader import attach_stub

__version__ = "0.1.0"

_attribute, _, _names = attach_stub(__name__, __file__)
__all__ = sorted([*_names, "__version__"])


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module 'tanteo' has no attribute {name!r}; it has {', '.join(__all__)}")
    return _attribute(name)


def __dir__() -> list[str]:
    return list(__all__)
