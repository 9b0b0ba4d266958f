from . import stage as stage
from . import story as story
from .stage import Seen as Seen
from .stage import set_stage as set_stage
from .story import NEEDED as NEEDED
from .story import needed as needed
from .story import run_demo as run_demo
from .story import try_it as try_it
