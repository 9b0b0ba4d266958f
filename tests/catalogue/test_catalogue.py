"""A catalogue on disk: what is built, brought up to date, opened, and never half of it."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from scipy.spatial import ConvexHull

import tanteo
from random_parts import write_off
from tanteo.catalogue import (
    add_to_catalogue,
    build_catalogue,
    compiled_shape,
    known_stable_poses,
    open_catalogue,
    read_parts,
    stable_poses,
)
from tanteo.catalogue.signatures import coarse_field
from tanteo.catalogue.stability import hull_points
from tanteo.errors import InputError, PartError, UnitError
from tanteo.parts import read_part
from tanteo.posterior import prepare

TETRAHEDRON = "OFF\n4 4 0\n0 0 0\n{0} 0 0\n0 {0} 0\n0 0 {0}\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n"


@pytest.fixture
def parts(tmp_path, monkeypatch):
    monkeypatch.setenv("TANTEO_CACHE", str(tmp_path / "cache"))
    folder = tmp_path / "parts"
    folder.mkdir()
    for name, size in (("a", 20), ("b", 30), ("c", 40)):
        (folder / f"{name}.off").write_text(TETRAHEDRON.format(size))
    return folder


@pytest.fixture
def built(parts, tmp_path):
    build_catalogue(parts, tmp_path / "catalogue", unit="mm", workers=0)
    return tmp_path / "catalogue"


def names(folder):
    return [part.name for part in open_catalogue(folder)]


def test_parts_of_a_catalogue_are_those_of_their_files(parts, built):
    read = read_parts(parts, unit="mm", workers=0, cache=False)
    for stored, part in zip(open_catalogue(built), read, strict=True):
        assert (stored.name, stored.source, stored.unit) == (part.name, part.source, part.unit)
        np.testing.assert_array_equal(stored.vertices, part.vertices)
        np.testing.assert_array_equal(stored.planes.normals, part.planes.normals)
        assert prepare(stored).shape.bytes() == prepare(part).shape.bytes()


def test_a_part_of_a_catalogue_lies_as_that_of_its_file(parts, built, monkeypatch):
    read = list(read_parts(parts, unit="mm", workers=0, cache=False))
    lying = [stable_poses(part) for part in read]
    monkeypatch.setattr("tanteo.catalogue.stability._computed", lambda part: pytest.fail("it is in the catalogue"))
    for stored, part, expected in zip(open_catalogue(built), read, lying, strict=True):
        known = known_stable_poses(stored)
        np.testing.assert_array_equal([r.T_table_part for r in known], [r.T_table_part for r in expected])
        assert [(r.probability, r.height) for r in known] == [(r.probability, r.height) for r in expected]
        corners = {tuple(corner) for corner in part.vertices.astype(np.float32)}
        assert {tuple(corner) for corner in hull_points(stored)} == corners


def test_a_sheet_lies_on_both_sides(tmp_path):
    (tmp_path / "sheet.off").write_text("OFF\n4 2 0\n0 0 0\n50 0 0\n50 30 0\n0 30 0\n3 0 1 2\n3 0 2 3\n")
    assert build_catalogue(tmp_path / "sheet.off", tmp_path / "catalogue", unit="mm", workers=0).parts == 1
    lying = known_stable_poses(open_catalogue(tmp_path / "catalogue")[0])
    assert sum(rest.probability for rest in lying) == pytest.approx(1)
    assert {abs(rest.T_table_part[2, 2]) for rest in lying} == {1.0}


def test_of_a_fine_hull_a_few_corners_are_kept(tmp_path):
    k = np.arange(1500) + 0.5
    z, turn = 1 - k / 750, 2.4 * k
    ball = 50 * np.stack([np.cos(turn) * np.sqrt(1 - z * z), np.sin(turn) * np.sqrt(1 - z * z), z], axis=1)
    triangles = ConvexHull(ball).simplices
    out = np.sum(
        np.cross(*(ball[triangles[:, i]] - ball[triangles[:, 0]] for i in (1, 2))) * ball[triangles[:, 0]], axis=1
    )
    triangles[out < 0] = triangles[out < 0][:, ::-1]
    write_off(tmp_path / "ball.off", ball, triangles)
    hull = hull_points(read_part(tmp_path / "ball.off", unit="mm"))
    assert 100 < len(hull) <= 200
    for way in np.eye(3):
        assert (hull @ way).max() == pytest.approx(0.05, abs=7e-4)


def test_a_catalogue_is_a_sequence_of_parts(built):
    catalogue = open_catalogue(built)
    assert len(catalogue) == 3
    assert catalogue["b"] is catalogue[1]
    assert [part.name for part in catalogue[-2:]] == ["b", "c"]
    assert catalogue.units == {"mm"}
    with pytest.raises(IndexError):
        catalogue[3]
    with pytest.raises(InputError, match=r"expected one of a, b, c, got 'd'"):
        catalogue["d"]


def test_what_has_not_changed_is_not_read_again(parts, built):
    before = (built / "catalogue.json").read_bytes()
    again = build_catalogue(parts, built, unit="mm", workers=0)
    assert (again.read, again.kept, again.dropped) == (0, 3, 0)
    assert (built / "catalogue.json").read_bytes() == before


def test_a_changed_file_is_read_and_a_lost_one_dropped(parts, built):
    (parts / "a.off").write_text(TETRAHEDRON.format(50))
    (parts / "b.off").unlink()
    again = build_catalogue(parts, built, unit="mm", workers=0)
    assert (again.parts, again.read, again.kept, again.dropped) == (2, 1, 1, 2)
    assert {part.name: round(part.box[1, 0], 6) for part in open_catalogue(built)} == {"a": 0.05, "c": 0.04}
    open_catalogue(built).check()


def test_a_renamed_file_is_the_same_part_under_its_new_name(parts, built):
    (parts / "a.off").rename(parts / "z.off")
    again = build_catalogue(parts, built, unit="mm", workers=0)
    assert again.read == 0
    assert sorted(names(built)) == ["b", "c", "z"]


def test_added_parts_have_names_of_their_own(built, tmp_path):
    more = tmp_path / "more"
    more.mkdir()
    (more / "a.off").write_text(TETRAHEDRON.format(60))
    added = add_to_catalogue(more, built, unit="mm", workers=0)
    assert (added.parts, added.read, added.kept) == (4, 1, 3)
    assert names(built) == ["a", "b", "c", "a.off"]


def test_adding_a_file_again_takes_its_old_parts_place(parts, built):
    (parts / "b.off").write_text(TETRAHEDRON.format(55))
    added = add_to_catalogue(parts / "b.off", built, unit="mm", workers=0)
    assert (added.parts, added.read) == (3, 1)
    assert open_catalogue(built)["b"].box[1, 0] == pytest.approx(0.055)


def test_a_file_is_the_same_from_another_folder(parts, built, monkeypatch):
    monkeypatch.chdir(parts)
    (parts / "b.off").write_text(TETRAHEDRON.format(65))
    assert add_to_catalogue("b.off", built, unit="mm", workers=0).parts == 3
    assert build_catalogue(".", built, unit="mm", workers=0).read == 0
    assert os.path.isabs(open_catalogue(built)["b"].source)


def test_many_small_additions_are_folded_into_few_segments(built, tmp_path, monkeypatch):
    monkeypatch.setattr("tanteo.catalogue.plan.SEGMENTS", 3)
    for k in range(6):
        (tmp_path / f"p{k}.off").write_text(TETRAHEDRON.format(10 + k))
        add_to_catalogue(tmp_path / f"p{k}.off", built, unit="mm", workers=0)
    catalogue = open_catalogue(built)
    assert len(catalogue.segments) <= 4
    assert len(catalogue) == 9
    catalogue.check()


def test_unreadable_files_are_reported_and_excluded(parts, tmp_path):
    (parts / "bad.off").write_text("OFF\nnothing")
    found = build_catalogue(parts, tmp_path / "out", unit="mm", workers=1)
    assert found.parts == 3
    assert [os.path.basename(one.path) for one in found.failures] == ["bad.off"]


def test_nothing_to_read_makes_no_catalogue(tmp_path):
    (tmp_path / "bad.off").write_text("OFF\nnothing")
    with pytest.raises(PartError, match=r"bad.off"):
        build_catalogue(tmp_path / "bad.off", tmp_path / "out", unit="mm", workers=0)
    assert not (tmp_path / "out" / "catalogue.json").exists()
    with pytest.raises(UnitError, match="unit"):
        build_catalogue(tmp_path / "bad.off", tmp_path / "out", workers=0)


def test_a_folder_with_other_files_is_refused_for_a_catalogue(parts):
    with pytest.raises(InputError, match=r"expected a catalogue or an empty folder to make one in, got 'a.off' in it"):
        build_catalogue(parts, parts, unit="mm", workers=0)


def test_a_missing_catalogue_is_reported_with_the_command(tmp_path):
    with pytest.raises(InputError, match=r"expected a catalogue .* tanteo catalogue build"):
        open_catalogue(tmp_path)
    with pytest.raises(InputError, match="expected a catalogue"):
        add_to_catalogue(tmp_path, tmp_path / "none", unit="mm")


def test_read_parts_of_a_catalogue_names_open_catalogue(built):
    (failure,) = read_parts(built).failures
    assert "open_catalogue" in failure.reason


def test_a_second_writer_is_refused(parts, built):
    hold = "import sys, time; from pathlib import Path; from tanteo.catalogue.store import writer\n"
    hold += "with writer(Path(sys.argv[1])):\n    print('held', flush=True); time.sleep(60)"
    other = subprocess.Popen([sys.executable, "-c", hold, str(built)], stdout=subprocess.PIPE)
    try:
        assert other.stdout.readline().strip() == b"held"
        with pytest.raises(InputError, match="expected no other writer, got one at work"):
            build_catalogue(parts, built, unit="mm", workers=0)
        assert names(built) == ["a", "b", "c"]  # readers are not held up
    finally:
        other.kill()
        other.communicate()
    assert build_catalogue(parts, built, unit="mm", workers=0).parts == 3  # the lock ended with its process


def test_an_open_catalogue_stays_as_it_was_while_it_is_replaced(parts, built):
    catalogue = open_catalogue(built)
    (parts / "a.off").write_text(TETRAHEDRON.format(70))
    build_catalogue(parts, built, unit="mm", workers=0)
    assert catalogue["a"].box[1, 0] == pytest.approx(0.02)
    assert open_catalogue(built)["a"].box[1, 0] == pytest.approx(0.07)


@pytest.mark.skipif(os.name != "posix", reason="sends a signal")
@pytest.mark.parametrize("wait", [0.0, *(pytest.param(w, marks=pytest.mark.slow) for w in (0.05, 0.1, 0.15, 0.4))])
def test_a_killed_writer_leaves_the_old_catalogue(parts, built, wait):
    for k in range(30):
        (parts / f"n{k:02d}.off").write_text(TETRAHEDRON.format(10 + k))
    code = "import sys; print('go', flush=True); from tanteo.catalogue import build_catalogue; "
    code += "build_catalogue(sys.argv[1], sys.argv[2], unit='mm', workers=0)"
    other = subprocess.Popen([sys.executable, "-c", code, str(parts), str(built)], stdout=subprocess.PIPE)
    other.stdout.readline()
    deadline = time.monotonic() + 20
    while other.poll() is None and time.monotonic() < deadline:
        if len(list(built.glob("segment-*.parts"))) > 1:
            break
        time.sleep(0.005)
    time.sleep(wait)
    other.send_signal(signal.SIGKILL)
    other.communicate()
    catalogue = open_catalogue(built)
    assert len(catalogue) in (3, 33)
    catalogue.check()
    assert build_catalogue(parts, built, unit="mm", workers=0).parts == 33
    assert len(list(built.glob("segment-*"))) == 2 * len(open_catalogue(built).segments)  # nothing is left behind


def test_a_full_disk_changes_nothing(parts, built, monkeypatch):
    (parts / "d.off").write_text(TETRAHEDRON.format(50))

    def full(*args, **kwargs):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("tanteo.catalogue.segment.write_table", full)
    with pytest.raises(InputError, match=r"No space left on device. Nothing was changed"):
        build_catalogue(parts, built, unit="mm", workers=0)
    assert names(built) == ["a", "b", "c"]
    assert len(list(built.glob("segment-*"))) == 2


def spoil(path, at, value=None):
    data = bytearray(path.read_bytes())
    if value is None:
        del data[at:]
    else:
        data[at] ^= value
    path.write_bytes(bytes(data))


@pytest.mark.parametrize("suffix", [".parts", ".table"])
@pytest.mark.parametrize("share", [0.001, 0.3, 0.6, 0.999])
def test_damaged_bytes_are_an_error_and_never_an_answer(built, suffix, share):
    (file,) = built.glob(f"segment-*{suffix}")
    before = [(part.name, part.area, part.vertices.tobytes()) for part in open_catalogue(built)]
    spoil(file, int(share * file.stat().st_size), 0x55)
    try:
        catalogue = open_catalogue(built)
        after = [(part.name, part.area, part.vertices.tobytes()) for part in catalogue]
        catalogue.check()
    except InputError as error:
        message = str(error)
    else:  # a byte between two arrays, which is of none of them
        assert after == before
        message = "expected an undamaged catalogue"
    assert "expected an undamaged catalogue" in message


@pytest.mark.parametrize("suffix", [".parts", ".table"])
def test_a_truncated_file_is_reported_on_opening(built, suffix):
    (file,) = built.glob(f"segment-*{suffix}")
    spoil(file, file.stat().st_size // 2)
    with pytest.raises(InputError, match=r"bytes of segment-\w+\.(parts|table) instead of"):
        open_catalogue(built)


def test_a_manifest_that_is_not_as_it_was_written_is_refused(built):
    path = built / "catalogue.json"
    manifest = json.loads(path.read_text())
    for change, message in (
        ({"schema": "tanteo.catalogue/2"}, "another version of tanteo"),
        ({"schema": 3}, "no known schema"),
        ({"paths": ["other"]}, "wrong checksum"),
    ):
        path.write_text(json.dumps({**manifest, **change}))
        with pytest.raises(InputError, match=message):
            open_catalogue(built)
    for content in ("", "{", "[]", "[1]", "null", '"sha256"', "[" * 100_000):
        path.write_text(content)
        with pytest.raises(InputError, match="no manifest"):
            open_catalogue(built)


def test_another_format_is_built_anew(parts, built, monkeypatch):
    monkeypatch.setitem(sys.modules["tanteo.catalogue.store"].FORMATS, "table", 99)
    with pytest.raises(InputError, match=r"expected formats .*table 99.* got .*Build the catalogue again"):
        open_catalogue(built)
    assert build_catalogue(parts, built, unit="mm", workers=0).read == 3
    assert names(built) == ["a", "b", "c"]


def test_a_catalogue_opens_in_milliseconds(built):
    seconds = []
    for _ in range(5):
        start = time.perf_counter()
        open_catalogue(built)
        seconds.append(time.perf_counter() - start)
    assert min(seconds) < 0.05


@pytest.mark.slow
def test_identify_takes_a_catalogue_as_parts(tmp_path):
    build_catalogue("examples/parts", tmp_path / "c", workers=0)
    readings = tanteo.read_readings("examples/readings/bracket_left.csv")
    answer = tanteo.identify(readings, tanteo.open_catalogue(tmp_path / "c"), sd=1e-4)
    other = tanteo.identify(readings, tanteo.read_parts("examples/parts"), sd=1e-4)
    assert answer.best.part == other.best.part == "bracket_left"
    assert answer.best.probability == pytest.approx(other.best.probability, abs=1e-3)


def test_coarse_fields_are_cached_and_made_anew_if_damaged(tmp_path, monkeypatch):
    monkeypatch.setenv("TANTEO_CACHE", str(tmp_path / "cache"))
    write_off(
        tmp_path / "wedge.off",
        [(0, 0, 0), (90, 0, 0), (0, 50, 0), (0, 0, 20)],
        [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)],
    )

    def field():
        part = read_parts([tmp_path / "wedge.off"], unit="mm").parts[0]
        return coarse_field(part, lambda: compiled_shape(part))

    grid, levels = field()
    (kept,) = (tmp_path / "cache").rglob("*.field1")
    whole = kept.read_bytes()
    for damaged in (whole, whole[:-9], b"", b"no field"):
        kept.write_bytes(damaged)
        again = field()
        np.testing.assert_array_equal(again[0], grid)
        np.testing.assert_array_equal(again[1], levels)
        assert kept.read_bytes() == whole
    kept.unlink()
    monkeypatch.setattr("tanteo.catalogue.signatures._field", lambda part, shape: (grid, levels[:-1]))
    field()  # an entry with the original name and other content
    monkeypatch.undo()
    monkeypatch.setenv("TANTEO_CACHE", str(tmp_path / "cache"))
    np.testing.assert_array_equal(field()[1], levels)
