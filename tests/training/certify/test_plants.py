"""The plants of a certificate: all that the issue asks for, playable, and the paper's robot as measured."""

import re
from pathlib import Path

import numpy as np
import pytest

import mecanum_env
from mecanum_env.effects import CATALOGUE
from mecanum_env.effects.apply import active_effects
from mecanum_env.errors import InputError
from mecanum_env.model import Model
from mecanum_env.tankendo import Opponent, Opponents
from mecanum_env.tankendo.plant import compile_model
from mecanum_env.tankendo.randomize import sampler_for
from sysid.studies.paper_gap.drives import PAPER, TOLERANCE, drive_metrics
from training.certify.plants import GROUPS, realistic_sizes, robot_level, robot_variants, select_variants
from training.certify.variations import certificate_variants
from training.train.robots import level_models, varied_models

ROOT = Path(mecanum_env.__file__).parents[1]


@pytest.fixture
def identified(paper: Model) -> Model:
    """Return a model with two effects and what a fit leaves open."""
    found = paper.with_effect("backlash", gap_deg=2.0).with_effect("command_latency", delay_s=0.03)
    return Model(
        found.wheel,
        found.robot,
        found.effects,
        uncertainty={"effects": {"backlash": {"gap_deg": {"low": 1.5, "high": 2.5}}}},
    )


def test_the_robot_level_plant_has_the_paper_s_six_figures(paper):
    off = np.abs(drive_metrics(robot_level(paper)).six - PAPER) / TOLERANCE
    assert off.max() < 1.0


def test_every_cause_of_the_catalogue_has_a_size_that_acts(paper):
    sizes = realistic_sizes(paper)
    assert set(sizes) >= {effect.cause for effect in CATALOGUE.values()}
    for name, values in sizes.items():
        assert [effect.name for effect, _ in active_effects(paper.with_effect(name, **values))] == [name]


def test_every_plant_can_be_built_and_names_are_unique(identified):
    found = robot_variants(identified)
    assert len({plant.name for plant in found}) == len(found)
    for plant in found:
        compile_model(plant.model, plant.physics)
        if plant.randomize == "posterior":
            assert sampler_for("posterior", plant.model) is not None


def test_all_groups_are_there_in_order(identified):
    groups = [plant.group for plant in robot_variants(identified)]
    assert tuple(dict.fromkeys(groups)) == GROUPS


def test_own_effects_alone_and_none(identified):
    own = {
        plant.name: set(plant.model.effects)
        for plant in robot_variants(identified)
        if plant.group == "effects"
    }
    assert own == {
        "bare": set(),
        "only-backlash": {"backlash"},
        "only-command_latency": {"command_latency"},
    }


def test_a_latency_that_is_there_already_grows(identified):
    late = next(plant for plant in robot_variants(identified) if plant.group == "latency")
    assert late.model.effects["command_latency"]["delay_s"] == pytest.approx(0.13)
    assert late.model.effects["backlash"] == identified.effects["backlash"]


def test_what_the_planar_plant_refuses_runs_on_rollers(paper):
    physics = {plant.name: plant.physics for plant in robot_variants(paper)}
    assert {name for name, kind in physics.items() if kind == "rollers"} == {"with-low_grip"}
    assert {plant.physics for plant in robot_variants(paper, "rollers")} == {"rollers"}


def test_a_selection_takes_names_and_groups_and_always_the_nominal_plant(identified):
    found = robot_variants(identified)
    chosen = select_variants(found, ["latency", "only-backlash"])
    assert [plant.name for plant in chosen] == ["nominal", "only-backlash", "latency+0.1s"]
    assert select_variants(found, []) == found


@pytest.mark.parametrize(
    ("wanted", "message"),
    [("with-backlsh", 'did you mean "with-backlash"'), ("posterior", "holds no uncertainty")],
)
def test_a_plant_that_is_not_there_is_refused(paper, wanted, message):
    with pytest.raises(InputError, match=message):
        select_variants(robot_variants(paper), [wanted])


def test_a_wrong_plant_is_one_short_sentence_with_the_nearest_name_the_groups_and_the_page(paper):
    with pytest.raises(InputError) as refused:
        select_variants(certificate_variants(paper), ["with-backlsh"])
    assert str(refused.value) == (
        "plants: no plant 'with-backlsh' (did you mean \"with-backlash\"?); name a group (nominal, effects, "
        "posterior, robot-level, latency, what-if, opponents, senses, adversary, held-out) or a plant of "
        "docs/certify.md"
    )


def test_the_page_lists_every_plant(identified):
    page = (ROOT / "docs" / "certify.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([a-z-]+)` \|[^|]*\| (`.*`) \|$", page, re.MULTILINE)
    listed = {(group, name) for group, names in rows for name in re.findall(r"`([^`]+)`", names)}
    played = {
        (one.group, re.sub(r"(?<=^only-).*|(?<=^with-).*", "EFFECT", one.name))
        for one in certificate_variants(identified)
    }
    assert listed == played


def test_opponents_and_senses_are_varied_as_plants_are(paper):
    found = certificate_variants(paper)
    assert [one.name for one in found if one.group == "opponents"] == [
        "opponents-varied",
        "lead-none",
        "lead-constant-velocity",
    ]
    assert [one.name for one in found if one.group == "senses"] == ["senses-usual", "senses-varied"]
    assert len({one.name for one in found}) == len(found)


def test_what_is_held_out_is_played_whatever_is_selected(paper):
    chosen = select_variants(certificate_variants(paper), ["latency"])
    names = [one.name for one in chosen]
    held_out = ["late-and-slow", "sluggish", "quick", "deliberate", "long-armed"]
    assert names == ["nominal", "latency+0.1s", *held_out]
    for one in chosen:
        compile_model(one.model, one.physics)


def test_held_out_opponents_lie_outside_the_ranges_that_are_trained_on(paper):
    def outside(name: str, opponent: Opponent) -> bool:
        low, high = Opponents().ranges[name]
        number = np.asarray(getattr(opponent, name))
        return bool((number < low).any() or (number > high).any())

    names = [name for name in Opponents().ranges if name not in ("swing_scale", "warning_s")]
    opponents = [one.opponent for one in certificate_variants(paper) if one.group == "held-out"]
    assert [any(outside(name, one) for name in names) for one in opponents if one] == [True] * 3


def test_held_out_robots_have_effects_that_no_training_draws(paper):
    drawn = varied_models(paper, (0.0, 0.15), 200, np.random.default_rng(0))
    trained = {name for one in (*drawn, *level_models(paper).values()) for name in one.effects}
    robots = [
        one.model for one in certificate_variants(paper) if one.group == "held-out" and not one.opponent
    ]
    assert all(set(one.effects) - trained for one in robots)
