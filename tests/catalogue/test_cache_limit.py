"""The cache of CAD files has a size limit, can be shown and emptied, and keeps what was used last."""

from __future__ import annotations

import os

import pytest

from tanteo.catalogue import read_parts
from tanteo.catalogue.cache import cache_folder, cache_limit, cache_size, clear_cache
from tanteo.errors import InputError

TETRAHEDRON = "OFF\n4 4 0\n0 0 0\n{0} 0 0\n0 {0} 0\n0 0 {0}\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n"


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("TANTEO_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def parts(tmp_path, sizes):
    for size in sizes:
        (tmp_path / f"{size}.off").write_text(TETRAHEDRON.format(size))
    return [tmp_path / f"{size}.off" for size in sizes]


def entries():
    return {path.name: path for path in (cache_folder() / "parts").rglob("*.part")}


def test_size_and_clearing(tmp_path):
    assert cache_size().entries == 0
    read_parts(parts(tmp_path, range(1, 6)), unit="mm")
    size = cache_size()
    assert size.parts == 5
    assert size.bytes == sum(path.stat().st_size for path in cache_folder().rglob("*.*") if path.is_file())
    assert clear_cache() == size
    assert cache_size().entries == 0
    assert len(read_parts(parts(tmp_path, range(1, 6)), unit="mm")) == 5


def test_above_the_limit_the_longest_unused_go(tmp_path, monkeypatch):
    files = parts(tmp_path, range(1, 11))
    read_parts(files, unit="mm")
    names = {}
    for file in files:
        before = {name: path.stat().st_mtime_ns for name, path in entries().items()}
        for path in entries().values():
            os.utime(path, (1000, 1000))
        read_parts([file], unit="mm")
        names[file] = next(name for name, path in entries().items() if path.stat().st_mtime > 1000)
        assert names[file] in before
    for age, file in enumerate(files):
        os.utime(entries()[names[file]], (1000 + age, 1000 + age))
    used = files[0]
    read_parts([used], unit="mm")  # the oldest is used again
    total = cache_size().bytes
    monkeypatch.setenv("TANTEO_CACHE_LIMIT", f"{total}B")
    read_parts(parts(tmp_path, range(20, 22)), unit="mm")
    assert cache_size().bytes <= total
    assert names[used] in entries()
    assert names[files[1]] not in entries()


@pytest.mark.parametrize(("text", "bytes_of"), [("500MB", 5e8), ("2 GB", 2e9), ("1.5gb", 1.5e9), ("12345", 12345.0)])
def test_limits_as_typed(monkeypatch, text, bytes_of):
    monkeypatch.setenv("TANTEO_CACHE_LIMIT", text)
    assert cache_limit() == bytes_of


@pytest.mark.parametrize("text", ["much", "-1MB", "nan", "inf", "GB"])
def test_limits_that_are_none(monkeypatch, text):
    monkeypatch.setenv("TANTEO_CACHE_LIMIT", text)
    with pytest.raises(InputError, match="500MB"):
        cache_limit()
