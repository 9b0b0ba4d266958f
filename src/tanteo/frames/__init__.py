"""Represent frames with uncertainty, and compose, invert, relate, fuse and sample them.

``UncertainFrame`` is ``T exp(e)`` with ``e ~ N(0, C)``; all functions accept batches. Location vectors (the paper's six
numbers) and the covariance conventions of other software are for input and output.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.frames.covariances import (
        check_covariance,
        check_covariances,
        freeze,
        frozen_array,
        symmetrised,
        unit_diagonal,
    )
    from tanteo.frames.fusion import Fusion, fuse
    from tanteo.frames.location import (
        compose_locations,
        invert_location,
        loc_to_matrix,
        matrix_to_loc,
        relate_locations,
    )
    from tanteo.frames.location_jacobians import (
        E_r,
        J1_at_zero,
        J2_at_zero,
        J2_at_zero_inverse,
        J_ominus,
        K_r,
        body_covariance,
        compose_jacobians,
        differential_jacobian,
        differential_jacobian_inverse,
        location_covariance,
    )
    from tanteo.frames.named import (
        GTSAM,
        ROS,
        SPATIAL,
        TANTEO,
        CovarianceConvention,
        NamedCovariance,
        as_gtsam_covariance,
        as_ros_covariance,
        convention_jacobian,
        convert_covariance,
        from_gtsam_covariance,
        from_ros_covariance,
        name_covariance,
        uncertain_frame,
    )
    from tanteo.frames.propagation import compose_arrays, compose_fourth_order, congruence, invert_arrays, relate_arrays
    from tanteo.frames.uncertain import UncertainFrame, check_transforms, compose, invert, relate, sample

__all__ = [
    "GTSAM",
    "ROS",
    "SPATIAL",
    "TANTEO",
    "CovarianceConvention",
    "E_r",
    "Fusion",
    "J1_at_zero",
    "J2_at_zero",
    "J2_at_zero_inverse",
    "J_ominus",
    "K_r",
    "NamedCovariance",
    "UncertainFrame",
    "as_gtsam_covariance",
    "as_ros_covariance",
    "body_covariance",
    "check_covariance",
    "check_covariances",
    "check_transforms",
    "compose",
    "compose_arrays",
    "compose_fourth_order",
    "compose_jacobians",
    "compose_locations",
    "congruence",
    "convention_jacobian",
    "convert_covariance",
    "differential_jacobian",
    "differential_jacobian_inverse",
    "freeze",
    "from_gtsam_covariance",
    "from_ros_covariance",
    "frozen_array",
    "fuse",
    "invert",
    "invert_arrays",
    "invert_location",
    "loc_to_matrix",
    "location_covariance",
    "matrix_to_loc",
    "name_covariance",
    "relate",
    "relate_arrays",
    "relate_locations",
    "sample",
    "symmetrised",
    "uncertain_frame",
    "unit_diagonal",
]

__getattr__: Callable[[str], Any]
__dir__: Callable[[], list[str]]
__getattr__, __dir__ = lazy(
    __name__,
    {
        "covariances": "check_covariance check_covariances freeze frozen_array symmetrised unit_diagonal",
        "fusion": "Fusion fuse",
        "location": "compose_locations invert_location loc_to_matrix matrix_to_loc relate_locations",
        "location_jacobians": (
            "E_r J1_at_zero J2_at_zero J2_at_zero_inverse J_ominus K_r body_covariance "
            "compose_jacobians differential_jacobian differential_jacobian_inverse location_covariance"
        ),
        "named": (
            "GTSAM ROS SPATIAL TANTEO CovarianceConvention NamedCovariance as_gtsam_covariance "
            "as_ros_covariance convention_jacobian convert_covariance from_gtsam_covariance "
            "from_ros_covariance name_covariance uncertain_frame"
        ),
        "propagation": "compose_arrays compose_fourth_order congruence invert_arrays relate_arrays",
        "uncertain": "UncertainFrame check_transforms compose invert relate sample",
    },
)
