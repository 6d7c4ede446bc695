"""The folder of a command's results: whole, unmixed, with one writer, and the user's files kept."""

import json
import os
import shutil
from pathlib import Path

import pytest

from mecanum_env.errors import InputError
from mecanum_env.files import write_text
from mecanum_env.outputs import (
    MANIFEST,
    finish_interrupted,
    output_files,
    output_folder,
    read_manifest,
    require_whole,
)
from tests import crash

FILES = ("a.txt", "sub/b.txt", "c.txt")


def write(folder: Path, text: str, names=FILES) -> None:
    with output_folder(folder, "test", FILES, seed=3) as staged:
        for name in names:
            write_text(staged / name, text)


def swap_in(trace) -> int:
    """Return the index of the rename that decides."""
    staged = [Path(what).name.startswith(".mecanum-staged-") for _, what, _ in trace]
    return next(i for i, (name, *_) in enumerate(trace) if name == "replace" and staged[i])


def test_every_crash_leaves_the_old_results_or_the_new_ones(tmp_path):
    out = tmp_path / "out"

    write(out, "old")
    (out / "mine.txt").write_text("the user's")
    old = dict.fromkeys(FILES, b"old") | {"mine.txt": b"the user's"}
    new = {"a.txt": b"new", "sub/b.txt": b"new", "mine.txt": b"the user's"}
    seen = []

    def check(at: int) -> None:
        finish_interrupted(out)
        seen.append(crash.contents(out))
        assert seen[-1] in (old, new), at
        for name in FILES:
            require_whole(out / name)
        # The next command finds nothing in its way and leaves nothing behind.
        write(out, "next")
        assert sorted(os.listdir(out)) == ["a.txt", "c.txt", "mecanum-output.json", "mine.txt", "sub"]

    points = crash.crash_everywhere(lambda: write(out, "new", FILES[:2]), check, out)
    assert points > 20
    assert old in seen
    assert new in seen
    assert seen == sorted(seen, key=lambda one: one == new)


def test_every_crash_of_a_first_run_leaves_nothing_or_everything(tmp_path):
    out = tmp_path / "deep" / "out"

    def check(at: int) -> None:
        finish_interrupted(out)
        assert crash.contents(out) in ({}, dict.fromkeys(FILES, b"new")), at

    crash.crash_everywhere(lambda: write(out, "new"), check, tmp_path / "deep")


def test_a_crash_while_finishing_is_finished_later(tmp_path):
    out = tmp_path / "out"

    write(out, "old")
    with crash.disk_of() as disk:
        write(out, "new")
    swapped = disk.trace[swap_in(disk.trace)][2]
    shutil.rmtree(out)
    write(out, "old")
    with crash.disk_of(swapped), pytest.raises(crash.Killed):
        write(out, "new")
    assert (out / ".mecanum-commit").is_dir()

    def check(_at: int) -> None:
        finish_interrupted(out)
        assert set(crash.contents(out).values()) == {b"new"}

    assert crash.crash_everywhere(lambda: finish_interrupted(out), check, out) > 10


def test_everything_is_on_the_disk_before_the_swap(tmp_path):
    with crash.disk_of() as disk:
        write(tmp_path / "out", "new")
    swap = swap_in(disk.trace)
    synced = {Path(what).name for name, what, _ in disk.trace[:swap] if name == "fsync"}
    assert {"a.txt", "b.txt", "c.txt", MANIFEST, "sub"} <= synced


def test_a_second_writer_is_refused(tmp_path):
    with output_folder(tmp_path, "test") as staged:
        write_text(staged / "a.txt", "first")
        with (
            pytest.raises(InputError, match="another command is writing there; wait until it is done"),
            output_folder(tmp_path, "test"),
        ):
            pass
    assert (tmp_path / "a.txt").read_text() == "first"


def test_files_of_two_programs_in_one_folder_are_no_conflict(tmp_path):
    with output_files("one", tmp_path / "a.txt") as (first,):
        with output_files("two", tmp_path / "b.txt", tmp_path / "c.txt") as others:
            for path in others:
                path.write_text("two")
        # Whoever begins to write removes only what the dead have left.
        write(tmp_path / "sub", "x")
        first.write_text("one")
    assert crash.contents(tmp_path) == {
        **{"a.txt": b"one", "b.txt": b"two", "c.txt": b"two"},
        **{f"sub/{name}": b"x" for name in FILES},
    }
    runs = read_manifest(tmp_path)["runs"].values()
    assert sorted(run["command"] for run in runs) == ["one", "two"]


def test_a_writer_leaves_alone_what_another_has_staged(tmp_path):
    with output_files("one", tmp_path / "a.txt") as (first,):
        first.write_text("one")
        write(tmp_path, "x", FILES[1:])
        (tmp_path / ".mecanum-staged-of-the-dead").mkdir()
        write(tmp_path, "y", FILES[1:])
    assert (tmp_path / "a.txt").read_text() == "one"
    assert not list(tmp_path.glob(".mecanum-staged-*"))


def test_a_file_for_another_folder_is_written_whole_beside_the_results(tmp_path):
    out, page = tmp_path / "out" / "a.json", tmp_path / "pages" / "a.md"

    def work() -> None:
        with output_files("test", out, page) as paths:
            for path in paths:
                path.write_text("new")

    def check(_at: int) -> None:
        finish_interrupted(out.parent)
        found = crash.contents(tmp_path)
        seen.append([found.get(name, b"") == b"new" for name in ("out/a.json", "pages/a.md")])

    seen: list[list[bool]] = []
    crash.crash_everywhere(work, check, tmp_path)
    assert [True, True] in seen
    assert [False, True] not in seen
    work()
    assert set(read_manifest(out.parent)["files"]) == {"a.json"}


def test_no_file_is_replaced_if_the_block_fails(tmp_path):
    targets = [tmp_path / "a.txt", tmp_path / "b.txt", tmp_path / "elsewhere" / "c.txt"]

    def fail() -> None:
        with output_files("test", *targets) as paths:
            paths[0].write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


def test_the_manifest_says_what_wrote_the_files(tmp_path):
    write(tmp_path, "x")
    with output_folder(tmp_path, "other", ("d.txt",)) as staged:
        write_text(staged / "d.txt", "y")
    found = read_manifest(tmp_path)
    assert set(found["files"]) == {*FILES, "d.txt"}
    by = {name: found["runs"][entry["run"]] for name, entry in found["files"].items()}
    assert (by["a.txt"]["command"], by["a.txt"]["seed"], by["d.txt"]["command"]) == ("test", 3, "other")
    assert {"mecanum-tankendo", "python", "mujoco"} <= set(by["a.txt"]["versions"])


def test_equal_runs_have_equal_manifests(tmp_path):
    for name in ("one", "two"):
        write(tmp_path / name, "x")
    one, two = ((tmp_path / name / MANIFEST).read_bytes() for name in ("one", "two"))
    assert one == two


def test_a_file_of_another_run_is_refused(tmp_path):
    write(tmp_path, "old")
    (tmp_path / "a.txt").write_text("other")
    with pytest.raises(
        InputError, match=r"a\.txt: is not the file that mecanum-output\.json beside it names"
    ):
        require_whole(tmp_path / "a.txt")
    require_whole(tmp_path / "c.txt")


def test_a_failing_block_leaves_the_old_results_and_no_folder(tmp_path):
    def fail() -> None:
        with output_folder(tmp_path / "new" / "out", "test") as staged:
            write_text(staged / "a.txt", "half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert os.listdir(tmp_path) == []


def test_folders_and_files_in_the_way_are_named(tmp_path):
    (tmp_path / "a.txt").mkdir()
    with pytest.raises(InputError, match=r"a\.txt: is a folder, must be a file"):
        write(tmp_path, "x")
    (tmp_path / "a.txt").rmdir()
    (tmp_path / "sub").touch()
    with pytest.raises(InputError, match="sub: is a file, must be a folder"):
        write(tmp_path, "x")
    assert os.listdir(tmp_path) == ["sub"]


def test_a_manifest_of_another_program_stays(tmp_path):
    (tmp_path / MANIFEST).write_text("[]")
    with pytest.raises(InputError, match="not written by this project"):
        write(tmp_path, "x")


@pytest.mark.parametrize("name", ["../outside.txt", "/tmp/outside.txt", "link/outside.txt", ".."])
def test_a_made_up_interrupted_write_reaches_nothing_outside(tmp_path, name):
    out = tmp_path / "out"
    commit = out / ".mecanum-commit"
    commit.mkdir(parents=True)
    (tmp_path / "outside.txt").write_text("precious")
    (out / "link").symlink_to(tmp_path)
    for files, absent in (({name: {"sha256": ""}}, []), ({}, [name])):
        entry = {"format": "mecanum-output/1", "files": files, "runs": {}, "absent": absent}
        (commit / MANIFEST).write_text(json.dumps(entry))
        with pytest.raises(InputError, match="which is outside of"):
            finish_interrupted(out)
    assert (tmp_path / "outside.txt").read_text() == "precious"


def test_results_in_a_folder_that_cannot_be_finished_are_refused(tmp_path):
    out = tmp_path / "out"
    commit = out / ".mecanum-commit"
    commit.mkdir(parents=True)
    (out / "a.txt").mkdir()
    (commit / "a.txt").touch()
    (commit / MANIFEST).write_text(
        json.dumps({"format": "mecanum-output/1", "files": {"a.txt": {"sha256": ""}}, "absent": []})
    )
    with pytest.raises(InputError, match="a command was interrupted when it wrote its results"):
        require_whole(out / "a.txt")
