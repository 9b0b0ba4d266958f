"""``tanteo view``: what is refused, the message without viser, and the pages of scene, example and record."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tanteo.bench.demo
from tanteo.planning import Action
from tanteo.render.live import Show

DEMO = Path(tanteo.bench.demo.__file__).parent
SCENE = ("--scene", DEMO / "scene.toml")
PARTS = ("--parts", *(DEMO / "parts" / f"bracket_{side}.stl" for side in ("left", "right")), "--units", "mm")


@pytest.fixture
def there(monkeypatch):
    """As if viser were installed, whether it is or not."""
    monkeypatch.setattr("tanteo.cli.view.find_spec", lambda name: object())


@pytest.fixture
def opened(there, monkeypatch):
    """What would be shown: the arguments of ``play`` or ``replay``, which are ended as a person does it."""
    calls = []

    def stand_in(*args, ready, **options):
        calls.append((args, options))
        ready("http://127.0.0.1:8080")
        raise KeyboardInterrupt

    monkeypatch.setattr("tanteo.render.live.play", stand_in)
    monkeypatch.setattr("tanteo.render.live.replay", stand_in)
    return calls


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--port", "0"), "--port: expected a number from 1 to 65535, got 0"),
        ((*SCENE,), "--parts: expected the candidate parts, got none"),
        ((*PARTS,), "--scene: expected one with --parts, got none"),
        (("record.json", *SCENE, *PARTS), "--scene: expected a record or a scene, got both"),
        (("--policy", "best"), "--policy: expected one of information"),
        (("--seed", "-1"), "--seed: expected 0 or more"),
    ],
)
def test_refusals(run, there, options, message):
    result = run("view", *options)
    assert (result.code, result.out) == (2, "")
    assert message in result.err


def test_without_viser_it_names_the_package(run, monkeypatch):
    monkeypatch.setattr("tanteo.cli.view.find_spec", lambda name: None)
    result = run("view")
    assert (result.code, result.out) == (1, "")
    assert "pip install -e '.[viewer]'" in result.err


def test_the_example_needs_no_arguments(run, opened):
    result = run("view")
    assert (result.code, result.out) == (0, "Live page: http://127.0.0.1:8080 (Ctrl-C ends it)\n")
    (((make, seed, policy), options),) = opened
    assert (seed, policy, options) == (1, "information", {"port": 8080})
    show = make(seed, policy)
    assert isinstance(show, Show)
    assert len(show.session.start.targets) == 12
    assert show.session.stop.tolerance == pytest.approx(2e-3)
    assert [s.name for s in show.truth] == ["unknown"]
    assert [s.name for s in show.furniture] == ["table", "clamp"]
    assert show.hand is not None
    one, other = make(seed, policy).session.ask(), make(seed, policy).session.ask()
    np.testing.assert_array_equal(one.origin, other.origin)


def test_a_bare_laser_in_a_scene_of_ones_own(run, opened):
    assert run("view", *SCENE, *PARTS, "--bare", "--seed", "5", "--policy", "nearest", "--port", "9000").code == 0
    (((make, seed, policy), options),) = opened
    assert (seed, policy, options) == (5, "nearest", {"port": 9000})
    show = make(seed, policy)
    assert show.hand is None
    assert show.session.seed == 5
    assert [t.part.name for t in show.session.start.targets] == ["bracket_left", "bracket_right"]
    assert isinstance(show.session.ask(), Action)


def test_a_record_is_shown_step_by_step(run, opened, tmp_path):
    from tanteo.io import write_record
    from tanteo.render.live import moments

    run("view", *SCENE, *PARTS, "--bare")
    make = opened.pop()[0][0]
    session = make(1, "information").session
    while session.count < 2:
        action = session.ask()
        session.tell(action.read(action.expected))
    write_record(session, tmp_path / "session.json")
    assert run("view", tmp_path / "session.json").code == 0
    (((shown,), options),) = opened
    assert options == {"port": 8080}
    every = moments(shown)
    assert len(every) == 3
    np.testing.assert_array_equal(every[-1].state.poses, session.state.poses)
    assert every[0].action.number == 1
    assert [len(m.steps) for m in every] == [0, 1, 2]
    assert every[1].state.weights.max() <= every[2].state.weights.max() + 0.5


@pytest.mark.parametrize(
    "options",
    [("--unknown-prior", "1%"), ("--pose-prior", "garbage"), ("--bare",), ("--goal", "1mm"), ("--seed", "0")],
)
def test_a_record_refuses_options_of_a_session(run, tmp_path, options):
    code, out, err = run("view", str(tmp_path / "s.json"), "--no-open", *options)
    assert (code, out) == (2, "")
    assert f"{options[0]}: expected with a scene, got it with a record" in err
