"""Rigid motions, uncertain frames and limits of numbers.

Modules ``SO3`` and ``SE3`` are array functions without uncertainty: rotations ``(*batch, 3, 3)`` and rigid motions
``(*batch, 4, 4)``, so that composition is ``@`` and frames cancel: ``T_world_part = T_world_hand @ T_hand_part``.
Tangents are ``[v, w]``, translation first, and perturb on the right: ``T = T_mean @ SE3.exp(xi)``. An
:class:`UncertainFrame` is ``T exp(e)`` with ``e ~ N(0, C)``.
"""

from lazy_loader import attach_stub

from tanteo.geometry import se3 as SE3  # noqa: F401
from tanteo.geometry import so3 as SO3  # noqa: F401

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
