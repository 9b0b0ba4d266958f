from . import estimators as estimators
from . import latency as latency
from . import lifecycle as lifecycle
from . import network as network
from .intake import Intake as Intake
from .intake import Patience as Patience
from .node import RosNode as RosNode
from .types import filled as filled
