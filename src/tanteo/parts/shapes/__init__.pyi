from . import borders as borders
from . import near_planes as near_planes
from . import revolved as revolved
from .field import DistanceField as DistanceField
from .field import as_signed as as_signed
from .field import ball_contact as ball_contact
from .field import distance_field as distance_field
from .surface import ClosestPoints as ClosestPoints
