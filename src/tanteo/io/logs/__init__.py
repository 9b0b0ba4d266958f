"""Parse logs of other programs (probes, machines, robots, scanners, ranging sensors) into plain arrays.

Each format is one module and one entry of :data:`FORMATS`: its name, a function that recognizes it, and one that reads
it. The result is a :class:`Log` in the file's own units. ``tanteo.io.read_readings`` converts it to readings, once the
user has stated what the file lacks. Only :class:`TableText` opens files.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
