from .contents import Contents as Contents
from .formats import FORMATS as FORMATS
from .formats import recognise as recognise
from .formats import register_format as register_format
from .log import Log as Log
from .log import LogFormat as LogFormat
