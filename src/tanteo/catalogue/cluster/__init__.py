"""Distribute tasks over processes of one or many computers with Dask; tasks of a worker that dies are run again.

A *scheduler* is the address of a running Dask scheduler (``tcp://HOST:PORT``, started with ``dask scheduler`` and
``dask worker``), or ``local`` or ``local:8`` for processes of this computer that end with the work. Every worker needs
the same version of tanteo and the same file paths. Anybody who can reach a scheduler can run programs on its workers:
use it only in a network that you trust.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
