"""All controllers in one table, with the same results as in certificates."""

import json
from dataclasses import replace

import pytest

from mecanum_env.cli import run
from mecanum_env.errors import InputError
from mecanum_env.parallel import Workers
from mecanum_env.tankendo import Opponent
from training.certify import CertifyOptions, certify_controller
from training.certify.adversary import Search
from training.certify.plants import robot_level
from training.certify.variations import held_out_variants
from training.compare import compare_controllers
from training.compare.__main__ import main
from training.compare.report import (
    comparison_markdown,
    comparison_table,
    held_out_cells,
    label,
    metric_cells,
    success_cells,
)
from training.evaluate import Setup, controller_factory, evaluate_controller
from training.evaluate.metrics import share

NAMES = ("still", "retreat")
HELD_OUT = ["late-and-slow", "sluggish", "quick", "deliberate", "long-armed"]


@pytest.fixture(scope="module")
def found():
    from mecanum_env.model import paper_model

    return compare_controllers(NAMES, paper_model(), episodes=4, rollers=False, workers=Workers(jobs=1))


def successes(name, setup, paper):
    return sum(
        one.success for one in evaluate_controller(controller_factory(name, paper), setup, range(4)).episodes
    )


def test_the_results_are_those_of_the_episodes(found, paper):
    assert [row.controller for row in found.rows] == list(NAMES)
    row = found.rows[1]
    settings = ["easy", "normal", "hard", "robot-level", "latency+0.1s", *HELD_OUT]
    assert list(row.success) == settings == list(found.settings)
    assert row.success["normal"].successes == successes("retreat", Setup(paper), paper)
    assert row.success["easy"].successes == successes("retreat", Setup(paper, difficulty="easy"), paper)
    changed = Setup(robot_level(paper), known=paper)
    assert row.success["robot-level"].successes == successes("retreat", changed, paper)
    assert row.warning.episodes == 8
    assert row.track.success.trials == 1


def test_rollers_are_a_setting_of_their_own(paper):
    here = Workers(jobs=1)
    one = compare_controllers(["still"], paper, episodes=1, rollers=True, bound=False, workers=here)
    assert list(one.rows[0].success)[3] == "rollers"


def test_an_adversary_is_that_of_a_certificate(paper):
    here, search = Workers(jobs=1), Search(first=2, generations=1, candidates=2, best=1, episodes=2)
    row = compare_controllers(
        ["retreat"], paper, episodes=2, rollers=False, search=search, bound=False, workers=here
    ).rows[0]
    options = CertifyOptions(episodes=2, plants=("adversary",), workers=here, bound=False, search=search)
    certified = next(
        one for one in certify_controller("retreat", paper, options).plants if one.name == "adversary"
    )
    assert row.success["adversary"] == certified.success
    assert json.loads(json.dumps(row.adversary)) == certified.opponent


def test_held_out_rows_and_the_bound_are_those_of_a_certificate(found, paper):
    options = CertifyOptions(episodes=4, plants=("latency",), workers=Workers(jobs=1))
    certified = {one.name: one for one in certify_controller("retreat", paper, options).plants}
    assert list(found.held_out) == [one.name for one in held_out_variants(paper, "planar", Opponent())]
    for name in (*found.held_out, "latency+0.1s"):
        assert found.rows[1].success[name] == certified[name].success
        assert found.bound[name] == certified[name].bound
    assert found.bound["normal"] == certified["nominal"].bound


def test_every_row_has_every_cell(found):
    for cells in (success_cells(found), held_out_cells(found), metric_cells(found)):
        assert all(len(row) == len(cells[0]) for row in cells)
    assert "0.00 (0.00 .. 0.49)" in comparison_table(found)
    text = comparison_markdown(found, "python -m training.compare")
    tables = [line for line in text.splitlines() if line.startswith("|")]
    success, held_out, metrics = 2 + len(NAMES) + 1, 2 + len(NAMES) + 1, 2 + len(NAMES)
    assert len(tables) == success + held_out + metrics
    assert {line.count("|") for line in tables[:success]} == {len(found.settings) - len(HELD_OUT) + 2}


def test_mean_and_worst_are_those_of_what_is_held_out(found):
    shares = {name: share(won, 4) for name, won in zip(HELD_OUT, (4, 3, 1, 2, 3), strict=True)}
    row = replace(found.rows[0], success={**found.rows[0].success, **shares})
    head, line, *_ = held_out_cells(replace(found, rows=(row,)))
    assert head == ("controller", *HELD_OUT, "mean", "worst")
    assert line[-2:] == ("0.65", "0.25 on quick")


def test_rollers_and_the_adversary_have_no_bound(found):
    row = replace(found.rows[0], success={**found.rows[0].success, "rollers": share(1, 4)})
    head, *_, last = success_cells(replace(found, rows=(row,), settings={**found.settings, "rollers": ""}))
    assert last[0] == "bound"
    assert last[head.index("rollers")] == "-"


def test_the_bound_is_left_out_where_it_was_not_played(paper):
    one = compare_controllers(
        ["still"], paper, episodes=1, rollers=False, bound=False, workers=Workers(jobs=1)
    )
    assert one.bound == {}
    assert [row[0] for row in held_out_cells(one)] == ["controller", "still"]


def test_a_policy_is_shown_by_the_name_of_its_file():
    assert label("runs/mine/policy.npz") == "policy"
    assert label("mpc") == "mpc"
    assert label("retreat+compensated") == "retreat+compensated"


@pytest.mark.parametrize(
    ("names", "message"), [([], "must be at least one"), (["still", "still"], "each named once")]
)
def test_a_list_that_makes_no_table_is_refused(paper, names, message):
    with pytest.raises(InputError, match=message):
        compare_controllers(names, paper, episodes=1)


def test_the_program_writes_results_and_page(tmp_path, capsys):
    out, page = tmp_path / "c.json", tmp_path / "docs" / "c.md"
    arguments = [
        "still",
        "--episodes",
        "1",
        "--no-rollers",
        "--no-adversary",
        "--no-bound",
        "--jobs",
        "1",
        "--out",
        str(out),
    ]
    assert run(main, [*arguments, "--markdown", str(page)]) == 0
    assert "controller" in capsys.readouterr().out
    assert json.loads(out.read_text())["rows"][0]["controller"] == "still"
    assert page.read_text().startswith("# Results of `python -m training.compare`")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["retreat", "stil"], 'did you mean "still"'),
        (["still", "--out", "c.txt"], "must end in .json"),
        (["still", "--episodes", "0"], "episodes = 0"),
        (["still", "--jobs", "-1"], "jobs = -1, must be at least 0"),
    ],
)
def test_bad_input_is_one_sentence_and_writes_nothing(arguments, message, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(main, arguments) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
