"""Files are written whole or not at all."""

import json
import os

import pytest

from mecanum_env.errors import InputError
from mecanum_env.files import atomic_path, require_writable, write_json, write_text


def test_text_is_written_into_new_folders(tmp_path):
    target = tmp_path / "new" / "folder" / "a.txt"
    write_text(target, "häuser\n")
    assert target.read_text(encoding="utf-8") == "häuser\n"
    assert os.listdir(target.parent) == ["a.txt"]


def test_a_failing_block_leaves_the_old_file_and_nothing_else(tmp_path):
    target = tmp_path / "a.txt"
    target.write_text("old")

    def write_half() -> None:
        with atomic_path(target) as path:
            path.write_text("half of the n")
            raise RuntimeError("halfway")

    with pytest.raises(RuntimeError, match="halfway"):
        write_half()
    assert target.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_the_temporary_file_keeps_the_suffix_and_the_folder(tmp_path):
    with atomic_path(tmp_path / "film.mp4") as path:
        assert path.suffix == ".mp4"
        assert path.parent == tmp_path


def test_the_file_has_the_usual_permissions(tmp_path):
    usual = tmp_path / "usual"
    usual.touch()
    write_text(tmp_path / "ours", "")
    assert (tmp_path / "ours").stat().st_mode == usual.stat().st_mode


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_json_is_strict(tmp_path, bad):
    target = tmp_path / "a.json"
    write_json(target, {"x": 1.0})
    with pytest.raises(InputError, match=r"a\.json: not written, JSON knows no NaN"):
        write_json(target, {"x": bad})
    assert json.loads(target.read_text()) == {"x": 1.0}


def test_json_keeps_every_bit(tmp_path):
    numbers = [0.1 + 0.2, 1 / 3, 5e-324, 1.7976931348623157e308, -0.0]
    write_json(tmp_path / "a.json", numbers)
    back = json.loads((tmp_path / "a.json").read_text())
    assert [x.hex() for x in back] == [x.hex() for x in numbers]


def test_a_folder_that_cannot_be_is_named(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"file/a\.txt: cannot be written \(.*\); choose another folder"):
        write_text(tmp_path / "file" / "a.txt", "")


def test_a_target_that_is_a_folder_is_named(tmp_path):
    (tmp_path / "out").mkdir()
    with pytest.raises(InputError, match="out: cannot be written"):
        write_text(tmp_path / "out", "")
    assert os.listdir(tmp_path) == ["out"]


def test_files_that_can_be_written_are_told_from_those_that_cannot(tmp_path):
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    require_writable(tmp_path / "file", tmp_path / "new" / "folder" / "a.txt")
    with pytest.raises(InputError, match=r"file/new/a\.txt: cannot be written \(Not a directory\); choose"):
        require_writable(tmp_path / "b.txt", tmp_path / "file" / "new" / "a.txt")
    with pytest.raises(InputError, match="folder: is a folder, must be a file"):
        require_writable(tmp_path / "folder")
    assert sorted(os.listdir(tmp_path)) == ["file", "folder"]


def test_whether_a_file_can_be_written_leaves_it_as_it_is(tmp_path):
    (tmp_path / "a.txt").write_text("old")
    require_writable(tmp_path / "a.txt")
    assert (tmp_path / "a.txt").read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]
