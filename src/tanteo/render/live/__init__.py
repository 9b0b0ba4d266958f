"""Live page: a running session in a browser, in which the user can also choose readings.

A :class:`Snapshot` is a session at one moment. ``drawing`` converts it to primitives and ``panel`` to text, without
a browser. :class:`Player` runs a :class:`Show` on any :class:`Page`; :func:`play` and :func:`replay` open a page of
viser (extra ``viewer``), which they import.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
