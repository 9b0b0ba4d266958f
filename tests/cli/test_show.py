"""``part show``, presets, version, help; what goes where; and how fast the program starts."""

from __future__ import annotations

import json
import os
import pty
import shlex
import subprocess
import sys

import numpy as np
import pytest

import tanteo

TANTEO = [sys.executable, "-W", "error", "-c", "from tanteo.cli import main; main()"]


def tanteo_process(*args, **options):
    return subprocess.run([*TANTEO, *map(str, args)], capture_output=True, text=True, timeout=120, **options)


def test_show_describes_the_readings(run, parts):
    result = run("part", "show", parts / "wedge.stl", "--units", "mm")
    assert (result.code, result.err) == (0, "")
    lines = result.out.splitlines()
    assert lines[0] == "wedge: 60 x 40 x 30 mm, 6 planes, 12 edges, 8 vertices, 0 curved faces"
    assert "(read in mm)" in lines[1]
    assert "volume    63 cm3" in result.out
    assert "symmetry  none" in result.out
    assert "42.72" in result.out
    assert max(map(len, lines)) <= 120


def test_show_as_json(run, parts):
    result = run("part", "show", parts / "block.stl", "--units", "mm", "--json")
    document = json.loads(result.out, parse_constant=pytest.fail)
    assert (result.code, result.err) == (0, "")
    assert (document["schema"], document["part"], document["unit_of_file"]) == ("tanteo.part/1", "block", "mm")
    np.testing.assert_allclose(document["box_m"], [[0, 0, 0], [0.09, 0.05, 0.02]], atol=1e-9)
    assert document["volume_m3"] == pytest.approx(90e-6)
    assert [plane["name"] for plane in document["planes"]] == [f"face {k}" for k in range(6)]
    assert len(document["edges"]) == 12
    assert len(document["vertices"]) == 8
    assert document["symmetry"]["order"] == 4
    assert sorted(e["length_m"] for e in document["edges"])[0] == pytest.approx(0.02)


def test_units_matter(run, parts):
    assert "0.02362 x" not in run("part", "show", parts / "wedge.stl", "--units", "mm").out
    assert "1524 x 1016 x 762 mm" in run("part", "show", parts / "wedge.stl", "--units", "in").out


def test_version_and_help(run):
    assert run("--version") == (0, f"tanteo {tanteo.__version__}\n", "")
    for args in (
        ["--help"],
        ["identify", "--help"],
        ["locate", "--help"],
        ["part", "--help"],
        ["part", "show", "--help"],
        ["sensor", "--help"],
        *(["sensor", command, "--help"] for command in ("list", "show", "rig", "fit")),
    ):
        result = run(*args)
        assert result.code == 0
        assert "Usage: tanteo" in result.out
    text = run("identify", "--help").out
    for option in ("--parts", "--units", "--sensor", "--sd", "--form-sd", "--robot", "--tip-sd", "--significance",
        "--top",
                   "--as-published", "--json", "--seed", "-v"):  # fmt: skip
        assert option in text


def test_ctrl_c_is_130_without_traceback(run, parts, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("tanteo.catalogue.read_parts", interrupted)
    result = run("part", "show", parts / "wedge.stl", "--units", "mm")
    assert (result.code, result.out) == (130, "")
    assert "Traceback" not in result.err


def test_internal_errors_are_not_hidden(run, parts, monkeypatch):
    """Only what tanteo raises on purpose becomes a message: a bug must show."""

    def broken(*_, **__):
        raise ZeroDivisionError

    monkeypatch.setattr("tanteo.catalogue.read_parts", broken)
    with pytest.raises(ZeroDivisionError):
        run("part", "show", parts / "wedge.stl", "--units", "mm")


def on_terminal(args, **env):
    """Return standard output and error of a process that runs in a terminal."""
    reader, writer = pty.openpty()
    clean = {k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "FORCE_COLOR", "TERM")}
    process = subprocess.Popen(
        [*TANTEO, *map(str, args)], stdout=writer, stderr=writer, env=clean | {"TERM": "xterm"} | env
    )
    os.close(writer)
    out = b""
    while True:
        try:
            piece = os.read(reader, 65536)
        except OSError:  # Linux returns EIO at the end of a terminal
            break
        if not piece:
            break
        out += piece
    os.close(reader)
    process.wait(timeout=60)
    return process.returncode, out.decode()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals")
def test_colour_only_on_a_terminal_and_never_with_no_color(parts):
    args = ["part", "show", parts / "wedge.stl", "--units", "mm"]
    assert "\x1b" not in tanteo_process(*args).stdout
    assert "\x1b[1mwedge" in on_terminal(args)[1]
    code, text = on_terminal(args, NO_COLOR="1")
    assert code == 0
    assert "wedge: 60 x 40" in text
    assert "\x1b[1m" not in text
    wrong = ["part", "show", parts / "none.stl", "--units", "mm"]
    assert "\x1b[31merror:" in on_terminal(wrong)[1]
    assert "\x1b[31m" not in on_terminal(wrong, NO_COLOR="1")[1]
    assert tanteo_process(*wrong).stderr.startswith("error: ")


def test_a_closed_pipe_is_quiet(parts):
    words = [*TANTEO, "part", "show", str(parts / "wedge.stl"), "--units", "mm"]
    command = shlex.join(words) + " | true"
    result = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=60)
    assert "Traceback" not in result.stderr


def test_ascii_terminals_get_escapes(tmp_path, parts):
    odd = tmp_path / "ä\u4e2d.stl"
    odd.write_bytes((parts / "wedge.stl").read_bytes())
    result = tanteo_process("part", "show", odd, "--units", "mm", env=os.environ | {"PYTHONIOENCODING": "ascii"})
    assert result.returncode == 0
    assert "\\xe4\\u4e2d" in result.stdout


HEAVY = ("numpy", "scipy", "rich", "trimesh", "igl", "embreex", "OCP")


@pytest.mark.parametrize(
    "program",
    ["import tanteo", "from tanteo.cli import main\ntry: main(['--help'])\nexcept SystemExit: pass"],
    ids=["import", "help"],
)
def test_starting_imports_nothing_heavy(program):
    code = f"{program}\nimport sys\nprint('LOADED', *[m for m in {HEAVY} if m in sys.modules])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert result.stdout.splitlines()[-1] == "LOADED"


def test_python_m_is_the_same_command():
    result = subprocess.run(
        [sys.executable, "-m", "tanteo", "sensor", "list"], capture_output=True, text=True, timeout=60
    )
    assert result.returncode == 0
    assert "keyence_il300" in result.stdout
