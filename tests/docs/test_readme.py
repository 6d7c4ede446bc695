"""The README is short, and says of GapBench what its leaderboard says."""

import re

import pytest

from tests.docs.blocks import ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")
METHODS = {
    "ours (`sysid.gap`)": "ours",
    "CMA-ES over all effects": "cmaes_all",
    "mujoco.sysid": "mujoco_sysid",
    "nested friction models, BIC": "friction_bic",
    'always "no gap"': "always_no_gap",
}


def row(text: str, name: str) -> list[str]:
    found = re.search(rf"^ *\| {re.escape(name)} \| (.*) \|$", text, re.MULTILINE)
    assert found is not None
    return [cell.strip() for cell in found[1].split("|")]


def test_the_readme_has_fewer_than_200_lines() -> None:
    assert len(README.splitlines()) < 200


@pytest.mark.parametrize("shown", METHODS)
def test_the_readme_agrees_with_the_leaderboard(shown: str) -> None:
    board = (ROOT / "docs" / "results" / "gapbench.md").read_text(encoding="utf-8")
    head, found = row(board, "method"), row(board, METHODS[shown])
    wanted = ("right answers", "wrong answers", "false alarms", "closure")
    assert row(README, shown) == [found[head.index(name)] for name in wanted]
