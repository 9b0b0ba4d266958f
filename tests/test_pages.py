"""Code on the pages runs, and every command on them is one that there is, with options that it has."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest
import typer

from sensing_scenes import true_range
from tanteo.cli.app import app
from tanteo.geometry import SE3
from tanteo.io import read_scene
from tanteo.parts import read_part
from tanteo.planning import Probe, Session
from tanteo.planning.start import at_pose
from tanteo.posterior import prepare
from tanteo.sensors.presets import NoiseLaw
from unknown_scenes import unknown_scene

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted([*ROOT.glob("*.md"), *DOCS.glob("*.md")])
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def blocks(page, *languages):
    return [body for language, body in BLOCK.findall(page.read_text(encoding="utf-8")) if language in languages]


@pytest.fixture(scope="module")
def wedge():
    pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")
    return prepare(read_part(ROOT / "examples" / "parts" / "wedge.step"))


def active_sensing(wedge, folder):
    covariance = np.diag([5e-3, 5e-3, 5e-3, 0.05, 0.05, 0.05]) ** 2
    place = SE3.from_parts(np.eye(3), wedge.part.centroid)
    measure = lambda action: true_range(wedge, np.eye(4), action)  # noqa: E731
    return {"parts": [wedge.part], "T_world_place": place, "covariance": covariance, "measure": measure}


def replay(wedge, folder):
    probe = Probe("laser", NoiseLaw.of(3e-4))
    return {"session": Session(at_pose(wedge, np.eye(4), 1e-6 * np.eye(6)), probe)}


def reading_cad(wedge, folder):
    shutil.copy(ROOT / "examples" / "parts" / "wedge.step", folder / "bracket.step")
    mesh = next((ROOT / "src" / "tanteo" / "bench" / "demo" / "parts").glob("wedge.stl"))
    (folder / "parts").mkdir()
    for name in ("bracket.stl", "extra.stl", "parts/one.stl"):
        shutil.copy(mesh, folder / name)
    return {}


def report(wedge, folder):
    (folder / "examples").symlink_to(ROOT / "examples")
    return {}


def sense_part(wedge, folder):
    at = unknown_scene([wedge], 0, np.random.default_rng(3))
    return {
        "parts": [wedge.part], "T_world_place": at.start.Ts[0] @ SE3.from_parts(np.eye(3), wedge.part.centroid),
        "covariance": np.diag([8e-3, 8e-3, 4e-3, 0.03, 0.03, 0.1]) ** 2, "robot": at.robot,
        "clamp": at.rules.workspace.forbidden[0], "surface": at.furniture.surface,
    }  # fmt: skip


def sensing_hand(wedge, folder):
    at = read_scene(ROOT / "examples" / "scenes" / "bracket.toml")
    guess = at.guesses["plane"]
    return {
        "scene": at.scene, "hand": at.hand, "T_world_hand": at.T_world_hand, "point": guess.point,
        "normal": guess.normal
    }  # fmt: skip


def vision(wedge, folder):
    return report(wedge, folder)


def catalogue(wedge, folder):
    return report(wedge, folder)


def engine(wedge, folder):
    return report(wedge, folder)


def python(wedge, folder):
    return report(wedge, folder)


def round_features(wedge, folder):
    """Twelve touches of a bore of 10 mm in three rings, and the face in which it is."""
    from tanteo.features import Feature
    from tanteo.features.kinds import PLANE

    turn = np.tile(np.linspace(0, 2 * np.pi, 4, endpoint=False), 3)
    away = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    depths = np.outer(np.repeat([2e-3, 6e-3, 10e-3], 4), [0.0, 0.0, -1.0])
    return {
        "centres": 9e-3 * away + depths, "covs": np.tile(1e-10 * np.eye(3), (12, 1, 1)), "touches": away,
        "top": Feature(PLANE, np.eye(4), np.diag([1e-10, 1e-8, 1e-8]), "top"), "others": [], "parts": [wedge],
    }  # fmt: skip


def bench(wedge, folder):
    return {}


def sensors(wedge, folder):
    return {}


GIVEN = {
    made.__name__: made
    for made in (
        active_sensing,
        bench,
        catalogue,
        engine,
        python,
        replay,
        reading_cad,
        report,
        round_features,
        sense_part,
        sensing_hand,
        sensors,
        vision,
    )
}
"""What the code of a page takes as given."""

ELSEWHERE = {
    "README": "tests/test_readme.py",
    "CONTRIBUTING": "tests/test_extending.py",
    "view": "tests/render/live",
    "ros": "tests/ros",
}
"""Pages whose code runs there."""


def test_all_pages_with_code_run_somewhere():
    assert {page.stem for page in PAGES if blocks(page, "python")} == {*GIVEN, *ELSEWHERE}
    assert all((ROOT / place).exists() for place in ELSEWHERE.values())


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name == "sense_part" else name for name in GIVEN]
)
def test_code_runs(name, wedge, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TANTEO_CACHE", str(tmp_path / "cache"))
    names = GIVEN[name](wedge, tmp_path)
    for code in blocks(DOCS / f"{name}.md", "python"):
        exec(compile(code, f"{name}.md", "exec"), names)
    if "got" in names:
        assert names["got"].status == "acquired"
    if "done" in names:
        assert names["done"].visits


def typed(text):
    """Yield lines that begin with the program's name, continued ones as one, without trailing output."""
    for line in text.replace("\\\n", " ").splitlines():
        words = re.split(r"\s{2,}#?|\s#", line.removeprefix("$ ").strip())[0] if "\\" not in line else line
        if words.startswith("tanteo ") and "(" not in words:
            yield words


def commands(page):
    text = page.read_text(encoding="utf-8")
    spoken = re.findall(r"`(tanteo [^`\n]+)`", BLOCK.sub("", text))
    return sorted({*spoken, *(line for body in blocks(page, "", "console") for line in typed(body))})


def options(command):
    """Return the options of a command, or of all commands of a group."""
    inside = [options(one) for one in getattr(command, "commands", {}).values()]
    return {option for p in command.params for option in (*p.opts, *p.secondary_opts)}.union(*inside)


@pytest.mark.parametrize("page", [p for p in PAGES if commands(p)], ids=lambda page: page.stem)
def test_commands_and_their_options_exist(page):
    top = typer.main.get_command(app)
    for command in commands(page):
        here, words = top, shlex.split(command.replace("[", " ").replace("]", " "))[1:]
        while words and hasattr(here, "commands"):
            name, *rest = words
            if name.startswith("-") or re.fullmatch(r"[A-Z.]+", name):
                break
            choices = name.split("|")
            assert set(choices) <= set(here.commands), f"{page.name}: {command}"
            here, words = here.commands[choices[0]], rest
        known = options(here) | {"--help", "--install-completion"}
        given = {word.split("=")[0] for word in words if re.match(r"--?[a-z]", word)}
        assert given <= known, f"{page.name}: {command}: {sorted(given - known)}"
        for word in words:
            if word.startswith("examples/"):
                assert (ROOT / word).exists(), f"{page.name}: {command}"


def test_every_picture_is_made_by_a_script_or_command_and_shown():
    pictures = DOCS / "pictures"
    scripts = "".join(file.read_text(encoding="utf-8") for file in pictures.glob("*.py"))
    pages = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    for picture in (file.name for file in pictures.iterdir() if file.suffix in (".png", ".svg", ".jpg")):
        assert picture in scripts or f"--picture docs/pictures/{picture}" in pages, picture
        assert f"pictures/{picture})" in pages, picture
