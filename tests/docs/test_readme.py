"""The README is short, and says of GapBench and of controllers what their pages say."""

import re

import pytest

from tests.docs.blocks import ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")
COMPARISON = (ROOT / "docs" / "results" / "compare.md").read_text(encoding="utf-8")
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


def section(page: str, title: str) -> str:
    """Return the part of a page below a heading."""
    return page.split(f"## {title}\n")[1].split("\n## ")[0]


def shown_of(controller: str) -> list[str]:
    """Return the cells of a controller in the README's table, from the page of the comparison."""
    success, held_out = section(COMPARISON, "Success"), section(COMPARISON, "Held out")
    won = dict(zip(row(success, "controller"), row(success, controller), strict=True))
    apart = dict(zip(row(held_out, "controller"), row(held_out, controller), strict=True))
    # Of a share without its interval, and of the worst without its name.
    value = {name: cell.split()[0] for name, cell in (won | apart).items()}
    warning = "-"
    if controller != "bound":
        found = row(section(COMPARISON, "Warning, tracking, time"), controller)[0]
        warning = "never" if found.startswith("not reached") else " ".join(found.split()[:2])
    return [
        ", ".join(value[level] for level in ("easy", "normal", "hard")),
        *(value[name] for name in ("rollers", "robot-level", "latency+0.1s")),
        f"{value['mean']} ({value['worst']})",
        value["adversary"],
        warning,
    ]


def test_the_readme_agrees_with_the_comparison_of_controllers() -> None:
    shown = re.findall(r"^\| ([a-z]+) \| \d.* \|$", README, re.MULTILINE)
    assert {"mpc", "robust", "varied", "planned", "nominal", "bound"} <= set(shown)
    for controller in shown:
        assert row(README, controller) == shown_of(controller)
