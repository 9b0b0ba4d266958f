"""Workers that take too much or lose their parent, files that are none, and cache entries that were meddled with."""

import os
import shutil
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tanteo.catalogue import read_parts
from tanteo.catalogue.cache import cache_folder
from tanteo.errors import PartError
from tanteo.parts import read_part

TETRAHEDRON = "OFF\n4 4 0\n0 0 0\n{0} 0 0\n0 {0} 0\n0 0 {0}\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n"
posix = pytest.mark.skipif(os.name != "posix", reason="of POSIX systems")


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("TANTEO_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def folder(tmp_path):
    place = tmp_path / "parts"
    place.mkdir()
    for name, size in (("a", 20), ("b", 30)):
        (place / f"{name}.off").write_text(TETRAHEDRON.format(size))
    return place


def entries():
    return sorted((cache_folder() / "parts").rglob("*.part"))


def test_an_entry_under_the_name_of_another_is_not_used(folder):
    read_parts(folder, unit="mm")
    first, second = entries()
    one, other = first.read_bytes(), second.read_bytes()
    first.write_bytes(other)
    second.write_bytes(one)
    again = read_parts(folder, unit="mm")
    assert [part.volume for part in again] == pytest.approx([0.02**3 / 6, 0.03**3 / 6])
    assert (first.read_bytes(), second.read_bytes()) == (one, other)


@posix
def test_the_cache_is_its_owners_alone(folder, own_cache):
    read_parts(folder, unit="mm")
    assert stat.S_IMODE((own_cache / "parts").stat().st_mode) == 0o700
    (own_cache / "parts").chmod(0o777)
    (folder / "c.off").write_text(TETRAHEDRON.format(40))
    read_parts(folder, unit="mm")
    assert stat.S_IMODE((own_cache / "parts").stat().st_mode) == 0o700


@posix
def test_without_a_home_there_is_a_cache_for_a_while(folder, monkeypatch):
    def nowhere():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("TANTEO_CACHE")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", nowhere)
    assert cache_folder().name in ("Caches", f"tanteo-{os.getuid()}")
    monkeypatch.setenv("TANTEO_CACHE", "~nobody-of-this-name/cache")
    assert len(read_parts(folder, unit="mm")) == 2


@posix
def test_links_in_a_circle_devices_and_pipes_are_refused_soon(folder):
    (folder / "loop.stl").symlink_to("loop.stl")
    (folder / "zero.stl").symlink_to("/dev/zero")
    os.mkfifo(folder / "pipe.stl")
    with (folder / "huge.stl").open("wb") as file:
        file.truncate(100 << 30)
    began = time.perf_counter()
    parts = read_parts(folder, unit="mm")
    assert [part.name for part in parts] == ["a", "b"]
    assert {Path(f.path).stem for f in parts.failures} == {"loop", "zero", "pipe", "huge"}
    for name, got in (("loop", "a broken link"), ("zero", "a device"), ("pipe", "a device or a pipe")):
        with pytest.raises(PartError, match=f"{name}.stl: expected a file, got {got}"):
            read_part(folder / f"{name}.stl", unit="mm")
    with pytest.raises(PartError, match="expected a file of up to 1 GB, got 107 GB"):
        read_part(folder / "huge.stl", unit="mm")
    assert time.perf_counter() - began < 2


def test_whatever_a_reader_raises_costs_that_file_only(folder, monkeypatch):
    def broken(path, **rest):
        if path.endswith("b.off"):
            raise ZeroDivisionError("of its own")
        return read_part(path, **rest)

    monkeypatch.setattr("tanteo.catalogue.reading.read_part", broken)
    parts = read_parts(folder, unit="mm")
    assert [part.name for part in parts] == ["a"]
    assert (
        "b.off: expected a file that can be read, but its reader fails (ZeroDivisionError" in parts.failures[0].reason
    )


def test_one_unit_is_of_the_files_that_need_one(tmp_path, folder):
    trimesh = pytest.importorskip("trimesh")
    trimesh.creation.box((0.1, 0.2, 0.3)).export(folder / "box.glb")
    parts = read_parts(folder, unit="mm", workers=0)
    assert [part.unit for part in parts] == ["mm", "mm", "m"]
    alone = read_parts(folder / "box.glb", unit="in", workers=0)["box"]
    assert alone.unit == "in"
    assert alone.diagonal == pytest.approx(parts["box"].diagonal * 0.0254)


GREEDY = """
import sys
from tanteo.catalogue import worker
def read(path, **rest):
    if "much" in path: bytearray(3 << 30)
    return real(path, **rest)
real, worker.read_part = worker.read_part, read
worker.main()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not limit it")
@pytest.mark.parametrize(("memory", "size"), [(2 << 30, "2.15"), (None, "1.07")])
def test_a_file_that_needs_too_much_memory_costs_itself_only(folder, memory, size):
    """Without a stated limit it follows from the size of the file."""
    from tanteo.catalogue import pool

    names = ["a", "much", "b"]
    (folder / "much.off").write_text(TETRAHEDRON.format(10))
    requests = {i: pool.Request(str(folder / f"{name}.off"), "mm", name) for i, name in enumerate(names)}
    found = {}
    pool.read_in_processes(requests, found.__setitem__, workers=1, time_limit=30.0, command=GREEDY, memory=memory)
    assert [getattr(found[i], "name", None) for i in range(3)] == ["a", None, "b"]
    assert found[1] == f"much.off: expected to be read with {size} GB of memory, needs more. Simplify the part."


PARENT = """
import sys, threading
from tanteo.catalogue.pool import Request, read_in_processes
hangs = "import os, time\\nfrom tanteo.catalogue import worker\\ndef read(path, **rest):\\n"
hangs += "    open(path + '.pid', 'w').write(str(os.getpid()))\\n    time.sleep(60)\\n"
hangs += "worker.read_part = read\\nworker.main()"
read_in_processes({0: Request(sys.argv[1], "mm", "a")}, print, workers=1, time_limit=60.0, command=hangs)
"""


@posix
def test_a_worker_ends_with_its_parent(folder):
    parent = subprocess.Popen([sys.executable, "-c", PARENT, str(folder / "a.off")])
    written = folder / "a.off.pid"
    try:
        assert _within(20.0, lambda: written.exists() and written.read_text())
        worker = int(written.read_text())
    finally:
        parent.kill()
        parent.wait()
    assert _within(5.0, lambda: _gone(worker))


def _within(seconds, done):
    end = time.monotonic() + seconds
    while not done():
        if time.monotonic() > end:
            return False
        time.sleep(0.05)
    return True


def _gone(process):
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    stat_file = Path(f"/proc/{process}/stat")
    return stat_file.exists() and stat_file.read_text().rsplit(")", 1)[1].split()[0] == "Z"


def test_workers_import_nothing_from_the_folder_they_are_in(tmp_path, monkeypatch):
    """A folder of CAD files from elsewhere may hold anything; ``python -c`` would look there first."""
    pytest.importorskip("OCP", reason="reading STEP needs tanteo[step]")
    for name in ("numpy", "lxml", "OCP"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('taken over')\n")
    shutil.copy(Path(__file__).parents[2] / "examples/parts/block.step", tmp_path)
    monkeypatch.chdir(tmp_path)
    found = read_parts(["block.step"], workers=1)
    assert [part.name for part in found] == ["block"]


BUSY = """
from tanteo.catalogue import worker
def read(path, **rest):
    while True: pass
worker.read_part = read
worker.main()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not limit it")
def test_a_busy_machine_does_not_shorten_the_time_limit(folder, monkeypatch):
    from tanteo.catalogue import pool

    monkeypatch.setattr(pool, "LEAST_SECONDS", 0.5)
    found = {}
    (folder / "busy.off").write_text(TETRAHEDRON.format(10))
    request = {0: pool.Request(str(folder / "busy.off"), "mm", "busy")}
    pool.read_in_processes(request, found.__setitem__, workers=1, command=BUSY, time_limit=120.0)
    assert "s of processor time, got no end. Simplify the part." in found[0]


@posix
def test_an_interrupted_read_does_not_wait_for_its_workers(tmp_path):
    file = tmp_path / "part.stl"
    file.write_text("solid")
    slow = "import sys, time\nfor line in sys.stdin.buffer:\n    if b'path' in line:\n        time.sleep(60)"
    script = (
        "import os, signal, threading\n"
        "from tanteo.catalogue.pool import Request, read_in_processes\n"
        "threading.Timer(1.5, os.kill, (os.getpid(), signal.SIGINT)).start()\n"
        f"request = Request({str(file)!r}, 'mm', 'part')\n"
        f"read_in_processes({{0: request}}, print, workers=1, command={slow!r})\n"
    )
    start = time.monotonic()
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=100, check=False)
    assert "KeyboardInterrupt" in done.stderr
    assert time.monotonic() - start < 40
