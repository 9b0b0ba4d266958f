"""Names for the shapes of arrays. Leading axes (``*batch``) broadcast as in NumPy; everything is float64.

They are aliases for readers: the shape is part of the name's meaning, not checked at run time.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

FloatArray: TypeAlias = npt.NDArray[np.float64]
IntArray: TypeAlias = npt.NDArray[np.int64]
Indices: TypeAlias = npt.NDArray[np.int32]
BoolArray: TypeAlias = npt.NDArray[np.bool_]

Vectors: TypeAlias = FloatArray
"""``(*batch, 3)``: points [m], directions or normals (unit)."""

Rotations: TypeAlias = FloatArray
"""``(*batch, 3, 3)``: rotation matrices."""

Transforms: TypeAlias = FloatArray
"""``(*batch, 4, 4)``: homogeneous rigid motions, ``T_a_b`` maps points of b to a."""

Tangents: TypeAlias = FloatArray
"""``(*batch, 6)``: ``[v, w]``, translation first [m, rad]."""

Covariances: TypeAlias = FloatArray
"""``(*batch, k, k)``: symmetric positive semidefinite; 6 x 6 in the order of :data:`Tangents`."""

Adjoints: TypeAlias = FloatArray
"""``(*batch, 6, 6)``: adjoints and Jacobians over :data:`Tangents`."""

LocationVectors: TypeAlias = FloatArray
"""``(*batch, 6)``: the paper's ``(px, py, pz, psi, theta, phi)``, ``R = Rz(phi) Ry(theta) Rx(psi)``."""
