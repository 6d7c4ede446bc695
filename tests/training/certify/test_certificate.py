"""A certificate as a whole: reproducible, written and read back, judged by its exit code, drawn."""

import html
import json
import re
from dataclasses import replace

import pytest

from mecanum_env.cli import run
from mecanum_env.errors import InputError
from mecanum_env.model import paper_model
from mecanum_env.parallel import Workers
from mecanum_env.tankendo import opponent_from_dict
from training.certify.__main__ import main
from training.certify.certificate import certificate_to_dict, read_certificate, write_certificate
from training.certify.plants import HELD_OUT
from training.certify.report import certificate_table, write_certificate_page
from training.certify.run import CertifyOptions, certify_controller, episodes_of
from training.certify.variations import certificate_variants
from training.evaluate import Setup, controller_factory, evaluate_controller

MACHINE = ("timing", "timing_check", "passed")
QUICK = ("--episodes", "3", "--plants", "latency", "--jobs", "1", "--no-bound")
LENIENT = [
    *("--thresholds.success", "0", "--thresholds.worst-success", "0", "--thresholds.warning-s", "9"),
    *("--thresholds.tracking-m", "9", "--thresholds.saturated-share", "1", "--thresholds.overshoot", "9"),
    *("--thresholds.settling-s", "99", "--thresholds.held-out-success", "0"),
]


def reproducible(certificate) -> bytes:
    """Return the certificate as it is written, without what depends on the machine."""
    value = certificate_to_dict(certificate)
    return json.dumps({name: item for name, item in value.items() if name not in MACHINE}).encode()


def test_the_same_certificate_bit_for_bit_whatever_the_number_of_jobs(small):
    again = certify_controller(
        "retreat", paper_model(), CertifyOptions(4, ("latency", "with-backlash"), workers=Workers(jobs=2))
    )
    assert again == small
    assert reproducible(again) == reproducible(small)


def test_the_results_are_those_of_the_episodes(small, paper):
    played = evaluate_controller(controller_factory("retreat", paper), Setup(paper), range(4)).episodes
    assert small.nominal.success.successes == sum(one.success for one in played)
    late = paper.with_effect("command_latency", delay_s=0.1)
    played = evaluate_controller(controller_factory("retreat", paper), Setup(late), range(4)).episodes
    assert small.plants[1].name == "latency+0.1s"
    assert small.plants[1].success.successes == sum(one.success for one in played)
    assert small.warning.episodes == 8
    assert small.track.success.trials == 1


def test_every_planar_row_states_the_oracle_s_success_as_its_bound(small):
    assert [one.bound.trials for one in small.plants] == [1] * len(small.plants)
    assert all(one.share_of_bound is None or one.share_of_bound >= 0.0 for one in small.plants)


def test_held_out_rows_are_listed_apart(small):
    assert [one.name for one in small.held_out] == [
        *("late-and-slow", "sluggish", "quick", "deliberate", "long-armed"),
    ]
    assert small.worst not in small.held_out
    text = certificate_table(small)
    assert text.index("held out, seen by no training:") > text.index("with-backlash")
    assert "held-out success" in text


def test_the_opponent_of_a_row_is_in_the_file_in_a_form_that_can_be_played(small):
    quick = next(one for one in small.plants if one.name == "quick")
    assert opponent_from_dict(quick.opponent).warning_s == (0.34, 0.40)


def test_the_worst_plant_is_the_one_with_the_least_success(small):
    assert small.worst.success.value == min(
        one.success.value for one in small.plants if one.group != "held-out"
    )


def test_robots_drawn_from_the_posterior(paper):
    known = {"effects": {"speed_gain": {"gain": {"low": 0.8, "high": 1.0}}}}
    model = replace(paper.with_effect("speed_gain", gain=0.9), uncertainty=known)
    found = certify_controller(
        "still", model, CertifyOptions(2, ("posterior",), workers=Workers(jobs=1), bound=False)
    )
    assert [one.name for one in found.plants][:2] == ["nominal", "posterior"]
    assert not any("holds no uncertainty" in note for note in found.notes)


def test_written_and_read_back_it_is_the_same(small, tmp_path):
    write_certificate(small, tmp_path / "c.json")
    found = read_certificate(tmp_path / "c.json")
    assert found == small
    assert (found.timing, found.timing_check) == (small.timing, small.timing_check)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": "x"}, 'must be "mecanum-certificate/1"'),
        ({"plants": 3}, "certificate.plants: must be a list"),
        ({"track": {}}, "certificate.track: lacks success"),
    ],
)
def test_what_is_no_certificate_is_refused(small, tmp_path, change, message):
    (tmp_path / "c.json").write_text(json.dumps(certificate_to_dict(small) | change))
    with pytest.raises(InputError, match=re.escape(message)):
        read_certificate(tmp_path / "c.json")


def test_the_table_shows_plants_and_checks(small):
    text = certificate_table(small)
    for name in (
        "nominal",
        "latency+0.1s",
        "with-backlash",
        "warning for 90% success",
        "FAIL: retreat misses",
    ):
        assert name in text


def test_the_bar_knows_how_many_episodes_there_are(paper):
    seen = []
    options = CertifyOptions(4, ("latency",), workers=Workers(jobs=1), bound=False)
    certify_controller("still", paper, options, lambda _, count: seen.append(count))
    assert sum(seen) == episodes_of(options, paper)


def test_exit_codes_and_files(tmp_path, capsys, monkeypatch):
    def few(*given):
        found = certificate_variants(*given)
        return tuple(one for one in found if one.group != HELD_OUT or one.name == "quick")

    # The other rows that are held out change no verdict here, and take most of the time.
    monkeypatch.setattr("training.certify.run.certificate_variants", few)
    out = tmp_path / "c"
    assert run(main, ["still", *QUICK, "--out", str(out)]) == 1
    assert "FAIL: still misses" in capsys.readouterr().out
    assert run(main, ["still", *QUICK, *LENIENT, "--out", str(out)]) == 1  # it never gets to 90 %
    assert "FAIL: still misses warning for 90% success." in capsys.readouterr().out
    assert read_certificate(out / "certificate.json").controller == "still"
    assert run(main, ["oracle", "--difficulty", "easy", *QUICK, *LENIENT, "--out", str(out)]) == 0
    assert "PASS: oracle meets all 9 thresholds." in capsys.readouterr().out
    assert json.loads((out / "certificate.json").read_text())["passed"] is True


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["stil"], 'did you mean "still"'),
        (["still", "--plants", "moon"], "no plant 'moon'"),
        (
            ["still", "--plants"],
            "--plants: none is given; name plants or groups (nominal, effects",
        ),
        (["still", "--model", ""], "--model is empty; give a value, or leave it out"),
        (["still+compensated+compensated"], "must be one name or path, followed by +compensated once"),
        (["still", "--episodes", "0"], "episodes = 0, must be at least 1"),
        (["still", "--jobs", "-1"], "jobs = -1"),
        (["still", "--difficulty", "hrd"], 'did you mean "hard"'),
        (["still", "--model", "none.json"], "none.json: cannot be read"),
        (["still", "--thresholds.success", "2"], "thresholds: success = 2.0"),
    ],
)
def test_bad_input_is_one_sentence_and_writes_nothing(arguments, message, tmp_path, capsys):
    assert run(main, [*arguments, "--out", str(tmp_path / "c")]) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def page(small, tmp_path):
    write_certificate_page(small, tmp_path / "certificate.html")
    return tmp_path / "certificate.html"


def test_the_page_says_the_verdict_and_loads_nothing(page, small):
    text = page.read_text(encoding="utf-8")
    assert not re.search(r"<(?:script|link|img)[^>]*\b(?:src|href)\b", text)
    bare = re.sub(r"<(script|style).*?</\1>", " ", text, flags=re.S)
    words = " ".join(html.unescape(re.sub(r"<[^>]+>", " ", bare)).split())
    assert "FAIL: retreat misses" in words
    for plant in small.plants:
        assert plant.summary in words


@pytest.mark.parametrize("width", [390, 1280])
def test_no_text_lies_over_text(page, crossed_text, width):
    assert crossed_text(page, width) == []


def test_a_browser_without_network_draws_every_plot(page, draw_page):
    figures, drawn, console = draw_page(page)
    assert figures == 3
    assert drawn == figures
    assert console == []
