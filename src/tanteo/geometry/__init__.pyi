from . import limits as limits
from . import location as location
from . import location_jacobians as location_jacobians
from . import named as named
from . import propagation as propagation
from . import se3, so3
from . import special as special
from . import typing as typing
from .covariances import check_covariance as check_covariance
from .covariances import check_covariances as check_covariances
from .covariances import freeze as freeze
from .covariances import frozen_array as frozen_array
from .fusion import fuse as fuse
from .levenberg_marquardt import maximize as maximize
from .named import ROS as ROS
from .named import as_ros_covariance as as_ros_covariance
from .named import from_ros_covariance as from_ros_covariance
from .named import uncertain_frame as uncertain_frame
from .propagation import relate_arrays as relate_arrays
from .uncertain import UncertainFrame as UncertainFrame
from .uncertain import check_transforms as check_transforms
from .uncertain import compose as compose
from .uncertain import invert as invert
from .uncertain import relate as relate
from .uncertain import sample as sample

SE3 = se3
SO3 = so3
