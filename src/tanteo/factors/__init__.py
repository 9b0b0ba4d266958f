"""Measurement factors: one type for each kind of measurement (:doc:`/docs/engine`).

Every module of this package is imported. So a new kind is one file here and one in ``_core/factors``.
"""

import importlib
import pkgutil

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)

for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_module.name}")
