"""Work on the workers of a scheduler: the same on any number of them, and none is lost with a worker."""

import os
import re
import signal
import subprocess
import sys
import threading
import time

import pytest

from tanteo.catalogue import build_catalogue, open_catalogue, pool, spreading
from tanteo.catalogue.cluster import at_work, check_scheduler, run_tasks
from tanteo.cli import main
from tanteo.errors import InputError

pytest.importorskip("distributed")

TETRAHEDRON = "OFF\n4 4 0\n0 0 0\n{0} 0 0\n0 {0} 0\n0 0 {0}\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n"
SLOW = """
import os, time
def slow(k):
    time.sleep(0.3)
    return k * k, os.getpid()
def fatal(k):
    time.sleep(1)
    os._exit(3)
def wrong(k):
    raise ZeroDivisionError("of its own")
def listening(k):
    from pathlib import Path
    rows = [line.split() for name in ("tcp", "tcp6") for line in Path(f"/proc/net/{name}").read_text().splitlines()]
    return sorted(row[1] for row in rows if row[3] == "0A")
"""


@pytest.fixture
def parts(tmp_path, monkeypatch):
    monkeypatch.setenv("TANTEO_CACHE", str(tmp_path / "cache"))
    folder = tmp_path / "parts"
    folder.mkdir()
    for k in range(20):
        (folder / f"p{k:02d}.off").write_text(TETRAHEDRON.format(20 + k))
    (folder / "p07.off").write_text("OFF\n4 4 0\nno numbers\n")
    return folder


@pytest.fixture
def lent(tmp_path, monkeypatch):
    """A module that only this process has."""
    folder = tmp_path / "lent"
    folder.mkdir()
    (folder / "lent_work.py").write_text(SLOW)
    monkeypatch.syspath_prepend(str(folder))
    return folder


class Cluster:
    """A scheduler and workers as an administrator starts them, on loopback."""

    def __init__(self):
        self._started = []
        line = self._start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", until="Scheduler at:")
        self.address = re.search(r"tcp://\S+", line)[0]

    def worker(self):
        self._start("worker", self.address, "--no-dashboard", "--nthreads", "1", "--no-nanny", until="Registered to:")
        return self._started[-1]

    def _start(self, *command, until):
        own = [sys.executable, "-m", f"distributed.cli.dask_{command[0]}", *command[1:]]
        process = subprocess.Popen(own, stderr=subprocess.PIPE, text=True)
        self._started.append(process)
        line = next(line for line in process.stderr if until in line)
        threading.Thread(target=process.stderr.read, daemon=True).start()
        return line

    def end(self):
        for process in self._started:
            process.kill()
            process.wait()
            process.stderr.close()


@pytest.fixture
def cluster():
    own = Cluster()
    yield own
    own.end()


def data(folder):
    return {path.suffix: path.read_bytes() for path in folder.glob("segment-*")}


def test_large_files_are_tasks_of_their_own(tmp_path, monkeypatch):
    monkeypatch.setattr(spreading, "SMALL", 100)
    requests = {}
    for k, size in enumerate((20, 20, 500, 20)):
        (tmp_path / str(k)).write_bytes(b"x" * size)
        requests[k] = pool.Request(str(tmp_path / str(k)), "mm", str(k))
    submitted = []
    monkeypatch.setattr(spreading, "run_tasks", lambda scheduler, work, tasks, record: submitted.extend(tasks.values()))
    spreading.read_on_cluster(requests, print, "local:1")
    assert [list(task) for task in submitted] == [[0, 1, 2], [3]]


def test_a_catalogue_is_the_same_whoever_read_its_parts(parts, tmp_path, monkeypatch):
    here = build_catalogue(parts, tmp_path / "here", unit="mm", workers=0)
    monkeypatch.setattr(spreading, "SMALL", 1000)  # several tasks
    for count in (2,):
        out = tmp_path / f"by{count}"
        there = build_catalogue(parts, out, unit="mm", scheduler=f"local:{count}")
        assert (there.parts, there.read) == (here.parts, here.read) == (19, 19)
        assert [f.reason for f in there.failures] == [f.reason for f in here.failures]
        assert data(out) == data(tmp_path / "here")
        open_catalogue(out).check()


def test_a_worker_that_is_killed_loses_nothing(cluster, lent):
    from lent_work import slow

    first, _ = cluster.worker(), cluster.worker()
    found, killed = {}, []

    def record(k, result):
        found[k] = result
        if not killed:  # while both are at work
            killed.append(first.pid)
            os.kill(first.pid, signal.SIGKILL)

    run_tasks(cluster.address, slow, {k: k for k in range(12)}, record, modules=str(lent))
    assert {k: result[0] for k, result in found.items()} == {k: k * k for k in range(12)}
    assert 1 <= len({pid for _, pid in found.values()}) <= 2


def test_a_worker_that_comes_later_does_the_work(cluster, lent):
    from lent_work import slow

    later = threading.Timer(1.0, cluster.worker)
    later.start()
    found = {}
    run_tasks(cluster.address, slow, {0: 3}, found.__setitem__, modules=str(lent))
    later.join()
    assert found[0][0] == 9


@pytest.mark.slow
def test_a_task_that_ends_its_worker_costs_itself_only(lent):
    from lent_work import fatal

    found = {}
    run_tasks("local:1", fatal, {0: 1}, found.__setitem__, modules=str(lent))
    assert "every worker that tried it died" in found[0]


def test_what_the_work_raises_is_raised_here(lent):
    from lent_work import wrong

    with pytest.raises(ZeroDivisionError, match="of its own"):
        run_tasks("local:1", wrong, {0: 1}, print, modules=str(lent))


def test_a_cluster_without_workers_is_reported(cluster, monkeypatch):
    monkeypatch.setattr("tanteo.catalogue.cluster.work.LONGEST_WAIT", 1.0)
    with pytest.raises(InputError, match=r"expected a worker at tcp.*Start one"):
        run_tasks(cluster.address, abs, {0: -1}, print)


def test_a_scheduler_that_ends_is_reported(cluster, lent, monkeypatch):
    from lent_work import slow

    cluster.worker()
    start = time.monotonic()
    with pytest.raises(InputError, match="connection was lost"):
        run_tasks(cluster.address, slow, {k: k for k in range(9)}, lambda k, _: cluster.end(), modules=str(lent))
    assert time.monotonic() - start < 30


def test_a_missing_scheduler_is_reported(monkeypatch, capsys, parts, tmp_path):
    monkeypatch.setattr("tanteo.catalogue.cluster.work.CONNECT", 0.5)
    with pytest.raises(SystemExit) as ended:
        main(["catalogue", "build", str(parts), "--units", "mm", "--out", str(tmp_path / "c"), "--scheduler",
              "tcp://127.0.0.1:9"])  # fmt: skip
    assert ended.value.code == 2
    assert "--scheduler: expected a scheduler at tcp://127.0.0.1:9" in capsys.readouterr().err
    assert not (tmp_path / "c" / "catalogue.json").exists()


@pytest.mark.parametrize("address", ["here", "local:0", "local:x", "tcp://", "tcp://host", "8786", ""])
def test_what_is_no_address_is_refused(address, tmp_path):
    with pytest.raises(InputError, match="expected tcp://HOST:PORT, or local:N"):
        check_scheduler(address)
    with pytest.raises(InputError, match="scheduler"):
        build_catalogue(tmp_path, tmp_path / "c", scheduler=address)


def test_a_worker_with_another_version_is_reported():
    with pytest.raises(InputError, match=r"expected workers with tanteo 0\.0\.0"):
        at_work("0.0.0", None, "builtins", "abs", -1)


def test_a_file_that_is_another_one_there_is_not_taken(parts):
    path = str(parts / "p01.off")
    (found,) = spreading.read_batch({4: pool.Request(path, "mm", "p01", key="f" * 64, record=True)}).values()
    assert found.startswith(f"{path}: expected the same file on every worker")


def test_processes_end_when_who_began_them_was_killed():
    import psutil

    code = "import time, tanteo.catalogue as c, tanteo.catalogue.cluster.own as o; o.LEFT = 1.0\n"
    code += "c.cluster.run_tasks('local:1', time.sleep, {0: 600}, print)"
    with subprocess.Popen([sys.executable, "-c", code]) as begun:
        try:
            own = psutil.Process(begun.pid)
            patience = time.monotonic() + 200
            children, before = own.children(recursive=True), []
            while len({*children} & {*before}) < 3 and begun.poll() is None:  # scheduler, nanny, worker
                assert time.monotonic() < patience
                time.sleep(1)  # a process that queries the hardware lives for a moment only
                children, before = own.children(recursive=True), children
            assert len(children) >= 3
        finally:
            begun.kill()
    assert psutil.wait_procs(children, timeout=120)[1] == []


def test_processes_wait_for_one_that_is_connected():
    from distributed import Client

    from tanteo.catalogue.cluster import own_processes

    with own_processes(1) as client:
        assert client.run_on_scheduler(lambda dask_scheduler: dask_scheduler.idle_timeout) is None
        with Client(client.cluster):
            pass  # another that leaves
        assert client.run_on_scheduler(lambda dask_scheduler: dask_scheduler.idle_timeout) is None


def test_processes_that_cannot_begin_are_reported(monkeypatch):
    def none(**_):
        raise RuntimeError("Scheduler failed to start within 30s")

    monkeypatch.setattr("tanteo.catalogue.cluster.own.SubprocessCluster", none)
    with pytest.raises(InputError, match="2 processes of this computer, got: Scheduler failed"):
        run_tasks("local:2", abs, {0: -1}, print)


@pytest.mark.skipif(sys.platform != "linux", reason="reads the open ports from /proc")
def test_own_processes_listen_on_this_machine_only(lent):
    import lent_work

    before = set(lent_work.listening(0))
    found = {}
    run_tasks("local:1", lent_work.listening, {0: 0}, found.__setitem__, modules=str(lent))
    opened = set(found[0]) - before
    assert opened
    assert all(address.startswith("0100007F:") for address in opened)  # 127.0.0.1
