"""Write probing programs: a plan's touches in the language of a controller, which logs them as readings.

:func:`job_of` turns a plan into starts, contacts and ends of guarded motions, :func:`write_program` turns them into
text. :data:`PROGRAMS` lists the supported controllers.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
