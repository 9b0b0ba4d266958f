from . import control_variate as control_variate
from . import covariances as covariances
from . import modes as modes
from . import peaks as peaks
from . import placements as placements
from . import ridges as ridges
from . import sampler as sampler
from . import widths as widths
