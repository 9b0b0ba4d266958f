"""The public API: its names, their examples, and nothing else."""

from __future__ import annotations

import doctest
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import tanteo

EXAMPLES = Path(__file__).parents[1] / "examples"
PACKAGES = {"features", "fitting", "geometry"}
NAMES = sorted(set(tanteo.__all__) - PACKAGES - {"__version__"})


def test_dir_shows_the_public_names_only():
    assert dir(tanteo) == sorted(tanteo.__all__)
    assert len(tanteo.__all__) <= 44


def test_a_fresh_import_shows_the_same():
    code = "import tanteo; print(sorted(dir(tanteo)) == sorted(tanteo.__all__))"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "True"


@pytest.mark.parametrize("name", NAMES)
def test_the_example_in_its_docstring_runs(name, monkeypatch, tmp_path):
    """Examples run in a folder with the content of ``examples``, and know ``tanteo``."""
    for entry in EXAMPLES.iterdir():
        (tmp_path / entry.name).symlink_to(entry)
    monkeypatch.chdir(tmp_path)
    text = inspect.getdoc(getattr(tanteo, name))
    assert ">>>" in text, "an example is missing"
    test = doctest.DocTestParser().get_doctest(text, {"tanteo": tanteo}, name, name, 0)
    found = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(test)
    assert found.attempted
    assert not found.failed


@pytest.mark.parametrize("name", NAMES)
def test_its_docstring_describes_the_use(name):
    value = getattr(tanteo, name)
    if inspect.isfunction(value):
        text = inspect.getdoc(value)
        for parameter in inspect.signature(value).parameters.values():
            assert f"{parameter.name}:" in text, parameter.name
            assert parameter.annotation is not inspect.Parameter.empty
        assert inspect.signature(value).return_annotation is not inspect.Signature.empty
