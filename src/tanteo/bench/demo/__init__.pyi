from .stage import Seen as Seen
from .stage import set_stage as set_stage
from .story import needed as needed
from .story import run_demo as run_demo
