"""Folders of parts: order, names, failures, workers that crash or hang, and what is remembered."""

import os
import pickle
import subprocess
import sys
import time
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from tanteo.catalogue import read_parts
from tanteo.catalogue.cache import cache_folder
from tanteo.errors import InputError, UnitError
from tanteo.parts import read_part

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples" / "parts"
DATA = ROOT.parent / "shared" / "data"

TETRAHEDRON = "OFF\n4 4 0\n0 0 0\n{0} 0 0\n0 {0} 0\n0 0 {0}\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n"


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("TANTEO_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def folder(tmp_path):
    place = tmp_path / "parts"
    place.mkdir()
    for name, size in (("b", 30), ("a", 20), ("c", 40)):
        (place / f"{name}.off").write_text(TETRAHEDRON.format(size))
    (place / "notes.txt").write_text("not a part")
    (place / "below").mkdir()
    (place / "below" / "d.off").write_text(TETRAHEDRON.format(50))
    return place


def same(first, second):
    """Return whether two parts are equal bit for bit, apart from their names."""
    for group in ("", "planes", "edges", "corners"):
        a, b = (getattr(p, group) if group else p for p in (first, second))
        for field in fields(a):
            value, other = getattr(a, field.name), getattr(b, field.name)
            if isinstance(value, np.ndarray):
                np.testing.assert_array_equal(value, other, err_msg=field.name)
                assert value.dtype == other.dtype
    np.testing.assert_array_equal(first.symmetry.Ts, second.symmetry.Ts)
    assert (first.symmetry.axis is None) == (second.symmetry.axis is None)
    assert (first.unit, first.repairs, first.volume) == (second.unit, second.repairs, second.volume)
    for face, other in zip(first.faces, second.faces, strict=True):
        for field in fields(face):
            np.testing.assert_equal(getattr(face, field.name), getattr(other, field.name))


def test_a_folder_is_read_in_order_and_not_below(folder):
    calls = []
    parts = read_parts(folder, unit="mm", progress=lambda done, total: calls.append((done, total)))
    assert [part.name for part in parts] == ["a", "b", "c"]
    assert parts.failures == ()
    assert calls == [(1, 3), (2, 3), (3, 3)]
    assert parts["b"].volume == pytest.approx(0.03**3 / 6)
    with pytest.raises(InputError, match="expected one of a, b, c, got 'z'"):
        parts["z"]


def test_failures_are_sentences_and_the_others_are_read(folder):
    (folder / "aa.off").write_text("OFF\n1 1 0\n")
    (folder / "ab.stl").write_bytes(b"rubbish")
    parts = read_parts([folder, folder / "missing.off", folder / "below", folder / "a.off"], unit="mm", cache=False)
    assert [part.name for part in parts] == ["a", "b", "c", "d"]
    assert sorted(Path(failure.path).name for failure in parts.failures) == ["aa.off", "ab.stl", "missing.off"]
    assert all("expected" in failure.reason for failure in parts.failures)
    empty = read_parts(folder.parent, unit="mm")
    assert len(empty) == 0
    assert f"got none in this folder, but in {folder}: folders within" in empty.failures[0].reason


def test_the_unit_is_requested_once(folder):
    with pytest.raises(UnitError, match=r"length unit of a\.off and 2 more"):
        read_parts(folder)
    with pytest.raises(UnitError, match="'ell'"):
        read_parts(folder, unit="ell")


def test_equal_stems_get_different_names(folder):
    (folder / "below" / "a.off").write_text(TETRAHEDRON.format(60))
    (folder / "b.stl").write_bytes(_as_stl(folder / "b.off"))
    parts = read_parts([folder, folder / "below", folder / ".." / "parts" / "c.off"], unit="mm")
    assert [p.name for p in parts] == ["parts/a.off", "b.off", "b.stl", "c", "below/a.off", "d"]


def _as_stl(path):
    part = read_part(path, unit="mm")
    record = np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    rows = np.zeros(len(part.triangles), record)
    rows["v"] = 1e3 * part.vertices[part.triangles]
    return b"\0" * 80 + np.uint32(len(rows)).tobytes() + rows.tobytes()


def test_a_cached_part_is_a_part_under_its_own_name(folder):
    read_parts(folder, unit="mm")
    part = read_part(folder / "a.off", unit="mm")
    (folder / "other.off").write_bytes((folder / "a.off").read_bytes())
    again = read_parts(folder / "other.off", unit="mm")["other"]
    same(part, again)
    assert not again.vertices.flags.writeable
    assert repr(read_parts(folder, unit="mm")["a"]) == repr(part)
    assert replace(again, name="another").faces == again.faces
    same(part, pickle.loads(pickle.dumps(again)))
    with pytest.raises(AttributeError, match="colour"):
        _ = again.colour


def test_what_is_remembered_is_used_and_equal(folder, monkeypatch):
    first = read_parts(folder, unit="mm")
    monkeypatch.setattr("tanteo.catalogue.reading.read_part", _must_not_read)
    for one, two in zip(first, read_parts(folder, unit="millimetres"), strict=True):
        same(one, two)
    for again in (read_parts(folder, unit="mm", cache=False), read_parts(folder, unit="m")):
        assert not again.parts
        assert "its reader fails (AssertionError: the file was read again)" in again.failures[0].reason


def _must_not_read(*_args, **_kwargs):
    raise AssertionError("the file was read again")


def entry_of(path):
    """Return the entry in the cache that is written when a file is read."""
    kept = set(cache_folder().rglob("*.part"))
    for entry in kept:
        entry.unlink()
    read_parts(path, unit="mm")
    (entry,) = cache_folder().rglob("*.part")
    return entry


def test_a_changed_or_damaged_entry_is_read_again(folder):
    read_parts(folder, unit="mm")
    entry = entry_of(folder / "a.off")
    data = entry.read_bytes()
    flipped = [data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :] for at in range(0, len(data), 97)]
    for content in (b"", b"damaged", data[:-50], data + b" ", *flipped):
        entry.write_bytes(content)
        assert read_parts(folder, unit="mm")["a"].volume == pytest.approx(0.02**3 / 6)
        assert entry.read_bytes() == data
    (folder / "a.off").write_text(TETRAHEDRON.format(25))
    assert read_parts(folder, unit="mm")["a"].volume == pytest.approx(0.025**3 / 6)


def test_a_cache_that_cannot_be_written_does_no_harm(folder, monkeypatch, tmp_path):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("TANTEO_CACHE", str(tmp_path / "file" / "below"))
    assert len(read_parts(folder, unit="mm")) == 3


def test_the_cache_folder_follows_the_platform(monkeypatch):
    monkeypatch.delenv("TANTEO_CACHE")
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", "/somewhere")
    assert cache_folder() == Path("/somewhere/tanteo")
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setenv("LOCALAPPDATA", "/local")
    assert cache_folder() == Path("/local/tanteo")


WORSE = """
import os, sys, time
if "from tanteo.catalogue.worker import main; main()" in getattr(sys, "orig_argv", []):
    from tanteo.catalogue import worker
    real = worker.read_part
    def read(path, **rest):
        name = os.path.basename(path)
        if "crash" in name: os.abort()
        if "hang" in name:
            while True: time.sleep(1)
        return real(path, **rest)
    worker.read_part = read
"""


def test_a_crash_and_a_hang_cost_only_their_own_file(folder, tmp_path, monkeypatch):
    site = tmp_path / "site"
    site.mkdir()
    (site / "sitecustomize.py").write_text(WORSE)
    monkeypatch.syspath_prepend(str(site))  # the workers take it over
    for name in ("crash", "hang"):
        (folder / f"{name}.off").write_text(TETRAHEDRON.format(10))
    few = [f"m{k}" for k in range(20)]  # more meshes than are read in this process
    for name in few:
        (folder / f"{name}.off").write_text(TETRAHEDRON.format(20))
    files = [folder / f"{name}.off" for name in ("a", "crash", "b", "hang", "c", "gone", *few)]
    began = time.monotonic()
    found = read_parts(files, unit="mm", workers=2, time_limit=6.0)
    assert time.monotonic() - began < 40
    assert [part.name for part in found] == ["a", "b", "c", *few]
    why = {Path(failure.path).stem: failure.reason for failure in found.failures}
    assert "got a crash of the CAD reader" in why["crash"]
    assert "within 6 s, got no end" in why["hang"]
    assert "got nothing there" in why["gone"]
    same(found["a"], read_part(folder / "a.off", unit="mm"))


def test_a_script_without_main_guard_can_read_in_parallel(folder, tmp_path):
    for k in range(20):
        (folder / f"m{k}.off").write_text(TETRAHEDRON.format(20 + k))
    script = tmp_path / "script.py"
    script.write_text(
        f"from tanteo.catalogue import read_parts\nparts = read_parts({str(folder)!r}, unit='mm', workers=2)\n"
        "print(len(parts), len(parts.failures))\n"
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.split() == ["23", "0"]


@pytest.mark.slow
def test_examples_read_equal_in_processes_and_from_cache():
    pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")
    files = [EXAMPLES / f"{name}.step" for name in ("block", "flange", "hex_spacer", "bracket_left")]
    parallel = read_parts(files, workers=2)
    inline = read_parts(files, workers=0, cache=False)
    stored = read_parts(files)
    assert not parallel.failures
    for one, two, three in zip(parallel, inline, stored, strict=True):
        same(one, two)
        same(one, three)


@pytest.mark.slow
@pytest.mark.skipif(not DATA.exists(), reason=f"no shared data at {DATA}")
def test_many_real_parts_come_back_from_the_cache_in_no_time():
    pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")
    files = sorted((DATA / "step_confusable").glob("*.step"))[::18]
    first = read_parts(files)
    assert len(first) == len(files)
    began = time.monotonic()
    again = read_parts(files)
    assert time.monotonic() - began < 2.0 * max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))
    assert [part.name for part in again] == [file.stem for file in files]
