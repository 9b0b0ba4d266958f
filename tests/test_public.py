"""The front door: every name it promises is there, and opening it is quick."""

from __future__ import annotations

import importlib
import pkgutil
import subprocess
import sys

import pytest

import tanteo

HEAVY = ["OCP", "trimesh", "scipy.stats", "typer", "rich", "matplotlib", "cv2", "networkx", "scipy.spatial", "msgspec"]


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
    rooms = "tanteo.posterior, tanteo.paper, tanteo.io, tanteo.catalogue, tanteo.parts"
    code = f"import sys, tanteo, {rooms}; print([m for m in {HEAVY} if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


@pytest.mark.parametrize(
    "rooms", ["recognition, tanteo.io.readings.readings_csv, tanteo.catalogue", "session", "vision"]
)
def test_answers_need_no_scipy(rooms):
    code = f"import sys, tanteo.{rooms}; print('scipy' in sys.modules)"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "False"


def test_no_name_of_a_lazy_room_is_a_module_in_it():
    """Importing the module would hide the name."""
    rooms = [importlib.import_module(f"tanteo.{m.name}") for m in pkgutil.iter_modules(tanteo.__path__) if m.ispkg]
    for room in rooms:
        if "lazy" in vars(room):
            assert not {m.name for m in pkgutil.iter_modules(room.__path__)} & set(room.__all__), room
