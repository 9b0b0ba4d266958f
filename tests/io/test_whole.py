"""Files that would hang a reader or take all memory are refused by name, at once."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import zlib
from itertools import pairwise

import pytest

from tanteo.errors import InputError
from tanteo.io import load_record, read_camera, read_image, read_marks, read_prior, read_rig, read_scene
from tanteo.parts import read_whole

READERS = {
    "rig.toml": read_rig, "scene.toml": read_scene, "prior.toml": read_prior, "marks.csv": read_marks,
    "image.png": read_image, "session.json": load_record, "camera.yaml": read_camera,
}  # fmt: skip


@pytest.mark.parametrize("name", READERS)
def test_pipes_devices_folders_and_circles_are_refused(tmp_path, name):
    if name == "image.png":
        pytest.importorskip("cv2", reason="the extra tanteo[vision] is not installed")
    pipe, circle, folder = tmp_path / f"pipe-{name}", tmp_path / f"circle-{name}", tmp_path / f"folder-{name}"
    os.mkfifo(pipe)
    circle.symlink_to(circle)
    folder.mkdir()
    for path, got in ((pipe, "a pipe or device"), ("/dev/zero", "a pipe or device"), (folder, "a folder"),
                      (circle, "symbolic links"), (tmp_path / "missing", "No such file")):  # fmt: skip
        with pytest.raises(InputError, match=got) as error:
            READERS[name](path)
        assert str(error.value).startswith(str(path))


def test_a_document_has_no_more_than_a_document(tmp_path):
    path = tmp_path / "rig.toml"
    with path.open("wb") as file:
        file.truncate(4_000_001)
    with pytest.raises(InputError, match="up to 4 MB"):
        read_rig(path)
    assert len(read_whole(path, "a file", 4_000_001)) == 4_000_001


def test_a_name_that_no_file_can_have():
    with pytest.raises(InputError, match="null"):
        read_whole("a\0b", "a file")


NESTED = {
    "arrays": "a = " + "[" * 5000 + "]" * 5000,
    "tables": "a = " + "{b = " * 3000 + "1" + "}" * 3000,
    "dots": "a" + ".a" * 20_000 + " = 1",
}


@pytest.mark.parametrize("kind", NESTED)
def test_nested_tables_are_refused(tmp_path, kind):
    path = tmp_path / "rig.toml"
    path.write_text(NESTED[kind])
    for read in (read_rig, read_scene, read_prior):
        with pytest.raises(InputError, match=r"rig\.toml"):
            read(path)


@pytest.mark.parametrize("text", ["[" * 200_000, '{"a":' * 100_000 + "1" + "}" * 100_000])
def test_nested_records_are_refused(tmp_path, text):
    path = tmp_path / "session.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"session\.json"):
        load_record(path)


def test_references_that_grow_are_refused(tmp_path):
    pytest.importorskip("yaml", reason="the extra tanteo[vision] is not installed")
    path, rows = tmp_path / "camera.yaml", ["a: &a [x, x, x, x, x, x, x, x, x]"]
    rows += [f"{b}: &{b} [{', '.join([f'*{a}'] * 9)}]" for a, b in pairwise("abcdefghij")]
    path.write_text("\n".join([*rows, "model: *j"]))
    with pytest.raises(InputError, match="references"):
        read_camera(path)
    path.write_text("size: &k [640, 480]\nimage_size: *k\nK: [800, 0, 320, 0, 800, 240, 0, 0, 1]\nD: [0, 0, 0, 0, 0]\n")
    assert read_camera(path).size == (640, 480)


def png(width, height, rows=0):
    """Return a PNG with a stated size and a number of rows, all of zeros."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    packer = zlib.compressobj(1)
    data = b"".join(packer.compress(bytes(width + 1)) for _ in range(rows)) + packer.flush()
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


READ = "import sys, tanteo; print(tanteo.read_image(sys.argv[1]).shape)"


def test_an_image_larger_than_memory_is_refused(tmp_path):
    """It runs in its own process: OpenCV reads its limit when it is loaded."""
    pytest.importorskip("cv2", reason="the extra tanteo[vision] is not installed")
    path = tmp_path / "image.png"
    path.write_bytes(png(30_000, 30_000, 1))
    done = subprocess.run([sys.executable, "-c", READ, path], capture_output=True, text=True, check=False)
    assert "more than 64 million pixels" in done.stderr
    whole = png(40, 30, 30)
    path.write_bytes(whole)
    assert read_image(path).shape == (30, 40)
    for at in (8, whole.index(b"IDAT") - 4):  # the length of a chunk, which is allocated before it is read
        path.write_bytes(whole[:at] + b"\x7e\xaf\x33\x10" + whole[at + 4 :])
        with pytest.raises(InputError, match="one that breaks off: a part of 2125411088 bytes"):
            read_image(path)
    path.write_bytes(whole[:-20])
    with pytest.raises(InputError, match="one that breaks off"):
        read_image(path)
