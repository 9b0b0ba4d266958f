"""A file that is written over another: whole or not at all."""

from __future__ import annotations

import os
import stat

import pytest

from tanteo.replaced import replaced


def test_the_old_file_stays_until_all_is_written(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text("old")
    path.chmod(0o640)
    with replaced(path) as file:
        assert file.suffix == ".toml"
        file.write_text("half")
        assert path.read_text() == "old"
        file.write_text("new")
    assert path.read_text() == "new"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert os.listdir(tmp_path) == ["rig.toml"]


@pytest.mark.parametrize("error", [OSError, KeyboardInterrupt])
def test_what_fails_half_way_leaves_nothing(tmp_path, error):
    path = tmp_path / "r.html"
    path.write_text("old")

    def fail():
        with replaced(path) as file:
            file.write_text("half")
            raise error

    with pytest.raises(error):
        fail()
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["r.html"]


def test_a_new_file_has_the_usual_rights(tmp_path):
    usual = tmp_path / "usual"
    usual.touch()
    with replaced(str(tmp_path / "new.csv")) as file:
        file.write_text("x")
    assert (tmp_path / "new.csv").stat().st_mode == usual.stat().st_mode


def test_a_link_stays_and_its_file_is_replaced(tmp_path):
    (tmp_path / "real.json").write_text("old")
    (tmp_path / "link.json").symlink_to("real.json")
    with replaced(tmp_path / "link.json") as file:
        file.write_text("new")
    assert (tmp_path / "link.json").is_symlink()
    assert (tmp_path / "real.json").read_text() == "new"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names")
def test_a_device_or_a_pipe_is_written_to_itself(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with replaced(tmp_path / "pipe") as file:
        assert file == (tmp_path / "pipe").resolve()
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)


def test_where_no_other_file_may_be_the_own_one_is_written(tmp_path, monkeypatch):
    path = tmp_path / "mine.csv"
    path.write_text("old")

    def refuse(*_, **__):
        raise PermissionError

    monkeypatch.setattr(type(path), "touch", refuse)
    with replaced(path) as file:
        file.write_text("new")
    assert path.read_text() == "new"


def test_a_missing_folder_is_reported(tmp_path):
    with pytest.raises(FileNotFoundError), replaced(tmp_path / "no" / "r.csv"):
        pass


@pytest.mark.parametrize("durable", [True, False])
def test_what_is_durable_is_on_the_disk_before_it_has_its_name(tmp_path, monkeypatch, durable):
    path, there = tmp_path / "r.json", []
    monkeypatch.setattr(os, "fsync", lambda _: there.append(path.exists()))
    with replaced(path, durable=durable) as file:
        file.write_text("new")
    assert there == ([False, True] if durable else [])
    assert path.read_text() == "new"
