"""Seeds: those for development at will, sealed ones once and of one commit."""

from __future__ import annotations

import json
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from mecanum_env.checkout import changed_files
from mecanum_env.errors import InputError
from sysid.studies.zoo import seeds
from sysid.studies.zoo.seeds import (
    LEDGER,
    Block,
    claim,
    development_seeds,
    finish,
    read_ledger,
    spans,
    spread_seeds,
)

WANTED = Block(first=0, bench=150, robot=20, commit="abc", fingerprint="f00", date="2027-01-31")


@pytest.fixture
def root(tmp_path, monkeypatch) -> Path:
    """Return a checkout that is as in its commit, as git says."""
    monkeypatch.setattr(seeds, "changed_files", lambda _root: (LEDGER.as_posix(),))
    return tmp_path


def test_development_seeds_end_where_sealed_ones_begin():
    assert development_seeds(10, 990) == range(990, 1000)
    assert development_seeds(0, 1000) == range(1000, 1000)
    with pytest.raises(InputError, match="reach beyond 999"):
        development_seeds(11, 990)


def test_spread_seeds_cover_all_of_development():
    assert spread_seeds(4) == (0, 250, 500, 750)
    assert spread_seeds(0) == ()
    with pytest.raises(InputError, match="at most 1000"):
        spread_seeds(1001)


def test_sealed_seeds_are_written_down_before_a_run_and_never_given_twice(root):
    first = claim(root, WANTED)
    assert (first.seeds, first.finished) == (range(1000, 1150), False)
    assert read_ledger(root / LEDGER) == (first,)
    finish(root, first)
    assert read_ledger(root / LEDGER)[0].finished
    second = claim(root, WANTED)
    assert second.first == 1150
    assert [block.first for block in read_ledger(root / LEDGER)] == [1000, 1150]


def test_a_run_of_other_commands_does_not_go_on_with_seeds_of_one_of_the_same_commands(root):
    first = claim(root, WANTED)
    assert claim(root, WANTED) == first
    assert claim(root, replace(WANTED, driven="same")).first == 1150


def test_an_unfinished_run_of_the_same_code_goes_on(root):
    first = claim(root, WANTED)
    assert claim(root, replace(WANTED, date="2027-02-01")) == first
    assert claim(root, replace(WANTED, fingerprint="other")).first == 1150


def test_spent_seeds_are_refused_in_one_sentence(root):
    finish(root, claim(root, WANTED))
    with pytest.raises(InputError, match=r"seeds 1000-1149 were spent on 2027-01-31 with commit abc") as said:
        claim(root, WANTED, first=1100)
    assert "\n" not in str(said.value)
    with pytest.raises(InputError, match="is for development"):
        claim(root, WANTED, first=5)
    assert claim(root, WANTED, first=2000).seeds == range(2000, 2150)


def test_a_checkout_with_changes_spends_nothing(root, monkeypatch):
    monkeypatch.setattr(seeds, "changed_files", lambda _root: ("a.py", "b.py"))
    with pytest.raises(InputError, match=r"a\.py and 1 more: not as in the commit"):
        claim(root, WANTED)
    assert not (root / LEDGER).exists()


def test_a_broken_ledger_is_refused(root):
    (root / LEDGER).parent.mkdir(parents=True)
    (root / LEDGER).write_text(json.dumps({"blocks": [{"first": 1}]}))
    with pytest.raises(InputError, match="restore it from git"):
        claim(root, WANTED)


def test_git_tells_changed_and_new_files_but_not_ignored_ones(tmp_path):
    def git(*arguments: str) -> None:
        author = ["-c", "user.name=n", "-c", "user.email=e@example.org"]
        subprocess.run(["git", *author, *arguments], cwd=tmp_path, check=True, capture_output=True)

    git("init")
    (tmp_path / ".gitignore").write_text("out/\n")
    (tmp_path / "kept.py").write_text("1")
    (tmp_path / "edited file.py").write_text("1")
    git("add", ".")
    git("commit", "-m", "x")
    assert changed_files(tmp_path) == ()
    (tmp_path / "edited file.py").write_text("2")
    (tmp_path / "new").mkdir()
    (tmp_path / "new" / "a.py").write_text("1")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "b.py").write_text("1")
    assert sorted(changed_files(tmp_path)) == ["edited file.py", "new/a.py"]


def test_seeds_in_words():
    assert spans([3, 1, 2, 7, 9, 10]) == "1-3, 7, 9-10"
    assert spans([]) == ""
