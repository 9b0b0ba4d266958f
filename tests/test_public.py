"""The public API: every exported name exists, and imports are quick."""

from __future__ import annotations

import importlib
import pkgutil
import subprocess
import sys
from inspect import ismodule

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


@pytest.mark.parametrize("package", sorted(m.name for m in pkgutil.iter_modules(tanteo.__path__)))
def test_every_package_has_its_exported_names(package):
    module = importlib.import_module(f"tanteo.{package}")
    assert module.__doc__
    for name in getattr(module, "__all__", []):
        assert hasattr(module, name), name


def test_import_loads_nothing_heavy():
    packages = "tanteo.posterior, tanteo.paper, tanteo.io, tanteo.catalogue, tanteo.parts"
    code = f"import sys, tanteo, {packages}; print([m for m in {HEAVY} if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


@pytest.mark.parametrize(
    "packages",
    ["recognition, tanteo.io.readings.readings_csv, tanteo.catalogue", "planning.session.conversation", "vision"],
)
def test_answers_need_no_scipy(packages):
    code = f"import sys, tanteo.{packages}; print('scipy' in sys.modules)"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "False"


def test_no_exported_name_is_a_module_of_its_package():
    """Importing the module would hide the name."""
    packages = [importlib.import_module(f"tanteo.{m.name}") for m in pkgutil.iter_modules(tanteo.__path__) if m.ispkg]
    for package in packages:
        modules = {m.name for m in pkgutil.iter_modules(package.__path__)}
        hidden = [n for n in getattr(package, "__all__", []) if n in modules and not ismodule(getattr(package, n))]
        assert not hidden, package
