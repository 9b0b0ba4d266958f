"""The front door: every name it promises is there, and opening it is quick."""

from __future__ import annotations

import importlib
import pkgutil
import subprocess
import sys

import pytest

import tanteo

HEAVY = ["OCP", "trimesh", "scipy.stats", "typer", "rich", "matplotlib", "cv2", "networkx", "scipy.spatial"]


@pytest.mark.parametrize("name", tanteo.__all__)
def test_exported_names_exist(name):
    assert getattr(tanteo, name) is not None
    assert name in dir(tanteo)


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(AttributeError, match="identify"):
        _ = tanteo.recognise


@pytest.mark.parametrize("room", sorted(m.name for m in pkgutil.iter_modules(tanteo.__path__)))
def test_every_room_keeps_its_promises(room):
    module = importlib.import_module(f"tanteo.{room}")
    assert module.__doc__
    for name in getattr(module, "__all__", []):
        assert hasattr(module, name), name


def test_import_loads_nothing_heavy():
    rooms = "tanteo.matching, tanteo.io, tanteo.catalogue, tanteo.parts"
    code = f"import sys, tanteo, {rooms}; print([m for m in {HEAVY} if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"
