"""Reports of answers, sessions and plans, each as one HTML file that needs no network.

A page has the verdict, a drawing in 3-D, charts, figures, and the command that repeats the result. ``report_page``,
``session_page``, ``plan_page`` and ``distinction_page`` make pages, and ``write_report(path, page)`` writes a page to a
file. Callers may add their own :class:`Section` values.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
