"""An answer, a session or a plan as one HTML file that opens from disk, offline.

It has words, a picture in 3-D, charts, figures, and how to run it again. A page is made by ``report_page``,
``session_page``, ``plan_page`` or ``distinction_page``, and put to a file by ``write_report(path, page)``. Whoever has
more to tell about an answer hands in further :class:`Section` values.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
