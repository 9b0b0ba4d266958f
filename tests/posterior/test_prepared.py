"""What a part's shape is made into: kept beside the part in the cache, opened by other processes, never trusted."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bare_scenes import no_paths, touches_of
from tanteo import _core
from tanteo.catalogue import SHAPE, cache, read_parts
from tanteo.geometry import SE3
from tanteo.posterior import PreparedPart, Priors, Problem, prepare, sized

EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "parts"


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("TANTEO_CACHE", str(tmp_path / "cache"))


def flange():
    return read_parts(EXAMPLES / "flange.step", workers=0)["flange"]


def entry_of(part):
    return cache.cache_folder() / "parts" / part.derived["key"][:2] / f"{part.derived['key']}.{SHAPE}"


def opened(data):
    return _core.open_shape(np.frombuffer(data, dtype=np.uint8))


def test_an_opened_shape_answers_equally():
    part = flange()
    made, again = PreparedPart(part).shape, PreparedPart(flange()).shape
    assert entry_of(part).is_file()
    assert again.bytes() == made.bytes()
    rng = np.random.default_rng(5)
    points = part.centroid + 0.6 * part.radius * rng.normal(size=(300, 3))
    directions = rng.normal(size=(300, 3))
    for one, two in zip(_core.closest_points(made, points), _core.closest_points(again, points), strict=True):
        np.testing.assert_array_equal(one, two)
    for one, two in zip(
        _core.first_hits(made, points, directions), _core.first_hits(again, points, directions), strict=True
    ):
        np.testing.assert_array_equal(one, two)
    np.testing.assert_array_equal(made.samples, again.samples)


def test_nothing_is_prepared_before_its_first_use():
    part = flange()
    assert prepare(part).spacing > 0
    assert not entry_of(part).exists()


def test_other_buffers_are_refused():
    data = PreparedPart(flange()).shape.bytes()
    garbled = [data[:at] + bytes([data[at] ^ 64]) + data[at + 1 :] for at in range(0, len(data), 4999)]
    longer, nothing = data + bytes(64), bytes(len(data))
    for other in (b"", data[:7], data[:-64], data[: len(data) // 2], longer, nothing, b"x" * 9000, *garbled):
        with pytest.raises(ValueError, match="expected a shape"):
            opened(other)


@pytest.mark.parametrize("content", [b"", b"foreign", None], ids=["empty", "foreign", "cut"])
def test_a_damaged_entry_is_made_again(content):
    part = flange()
    right = PreparedPart(part).shape.bytes()
    entry = entry_of(part)
    entry.unlink()
    entry.write_bytes(right[:-64] if content is None else content)
    assert PreparedPart(flange()).shape.bytes() == right
    assert entry.read_bytes()[:-8] == right  # and a checksum


def test_a_part_that_is_not_of_the_cache_leaves_nothing_there(tmp_path):
    part = read_parts(EXAMPLES / "flange.step", workers=0, cache=False)["flange"]
    assert PreparedPart(part).shape.flats > 0
    assert not (tmp_path / "cache").exists()


def test_a_cache_that_cannot_be_written_does_no_harm(monkeypatch):
    part = flange()
    monkeypatch.setenv("TANTEO_CACHE", os.devnull)
    assert PreparedPart(part).shape.flats > 0


def test_another_process_maps_what_this_one_made():
    right = PreparedPart(flange()).shape.bytes()
    code = (
        "from tanteo.catalogue import SHAPE, read_parts; from tanteo.posterior import prepared\n"
        "prepared.compiled_shape = None  # cannot be made here\n"
        f"(part,) = read_parts({str(EXAMPLES / 'flange.step')!r})\n"
        "shape = prepared.prepare(part).shape\n"
        "maps = open('/proc/self/maps').read() if sys.platform == 'linux' else SHAPE\n"
        "print(len(shape.bytes()), SHAPE in maps)"
    )
    out = subprocess.run([sys.executable, "-c", f"import sys; {code}"], capture_output=True, text=True, check=True)
    assert out.stdout.split() == [str(len(right)), "True"]


def test_a_writer_that_is_killed_leaves_the_old_entry_or_new_one():
    part = flange()
    right = PreparedPart(part).shape.bytes()
    code = (
        "import sys; from tanteo.catalogue import cache, read_parts\n"
        f"(part,) = read_parts({str(EXAMPLES / 'flange.step')!r})\n"
        "print(flush=True)\n"
        f"while True: cache.store_derived(part, {SHAPE!r}, sys.argv[1].encode() * 200_000)"
    )
    for _ in range(5):
        writer = subprocess.Popen([sys.executable, "-c", code, "other"], stdout=subprocess.PIPE)
        assert writer.stdout is not None
        writer.stdout.readline()
        writer.kill()
        writer.wait()
        writer.stdout.close()
        assert entry_of(part).read_bytes()[:-8] in (right, b"other" * 200_000)
        assert PreparedPart(flange()).shape.bytes() == right


def test_log_densities_are_the_same_to_the_last_bit():
    part = flange()
    made, again = PreparedPart(part), PreparedPart(flange())
    rng = np.random.default_rng(2)
    points = _core.closest_points(made.shape, part.centroid + 0.6 * part.radius * rng.normal(size=(12, 3)))[1]
    problem = Problem(touches_of(points, 2e-4), no_paths(), sized(Priors(noise_factor=1.0), part.radius)).compiled(made)
    Ts = SE3.exp(1e-3 * rng.normal(size=(40, 6)))
    one, two = (_core.log_densities(of.shape, problem, Ts, np.zeros((40, 0))) for of in (made, again))
    assert np.isfinite(one).all()
    np.testing.assert_array_equal(one, two)
