"""An effect of one's own, defined in this one file, is known to every program."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.effects import CATALOGUE, Effect, Parameter, catalogue_table, register, registered
from mecanum_env.errors import InputError
from mecanum_env.model import EFFECT_PARAMETERS, model_from_dict, model_to_dict, paper_model
from mecanum_env.simulator import replay_bench
from sysid.gap.result import GapOptions
from sysid.gap.workflow import analyse
from training.certify.plants import robot_variants

from .conftest import BENCH_COMMAND, BENCH_TIME


def curved(_time_s, channels, values):
    def shown(name, channel):
        bend = values["per_krpm"] / 1000.0 if name.startswith("speed_") else 0.0
        return channel * (1.0 - bend * np.abs(channel))

    return {name: shown(name, channel) for name, channel in channels.items()}


CURVATURE = Effect(
    name="sensor_curvature",
    station="sensor",
    acts_on="sensor",
    parameters=(Parameter("per_krpm", "1/krpm", 0.0, (0.0, 3.0)),),
    summary="Measured wheel speeds lag behind the true ones in proportion to their square.",
    signature="A loss that grows faster than the speed.",
    direct_check="a wheel's true speed at full command, with a tachometer",
    realistic=lambda _: {"per_krpm": 0.5},
    change_channels=curved,
)


@pytest.fixture
def known() -> Iterator[None]:
    with registered(CURVATURE, after="sensor_lowpass"):
        yield


def test_schema_and_definitions_agree():
    defined = {name: tuple(p.name for p in effect.parameters) for name, effect in CATALOGUE.items()}
    assert list(defined.items()) == list(EFFECT_PARAMETERS.items())


def test_it_takes_its_place_in_the_chain_and_leaves_it_again():
    before = list(CATALOGUE)
    with registered(CURVATURE, after="sensor_lowpass"):
        assert list(CATALOGUE) == list(EFFECT_PARAMETERS)
        assert list(CATALOGUE).index("sensor_curvature") == list(CATALOGUE).index("sensor_lowpass") + 1
    assert list(CATALOGUE) == list(EFFECT_PARAMETERS) == before


@pytest.mark.parametrize(
    ("effect", "after", "message"),
    [
        (replace(CURVATURE, name="backlash"), None, "effect backlash: this name is taken"),
        (CURVATURE, "backlsh", r"no effect \(did you mean \"backlash\"\?\)"),
        (replace(CURVATURE, parameters=()), None, "needs parameters of different names"),
    ],
)
def test_a_definition_that_cannot_be_added_changes_nothing(effect, after, message):
    before = list(CATALOGUE)
    with pytest.raises(InputError, match=message):
        register(effect, after=after)
    assert list(CATALOGUE) == list(EFFECT_PARAMETERS) == before


@pytest.mark.usefixtures("known")
def test_the_simulator_shows_it():
    plain = replay_bench(paper_model(), BENCH_TIME, BENCH_COMMAND)
    model = paper_model().with_effect("sensor_curvature", per_krpm=1.0)
    bent = replay_bench(model_from_dict(model_to_dict(model)), BENCH_TIME, BENCH_COMMAND)
    np.testing.assert_allclose(bent, plain * (1.0 - np.abs(plain) / 1000.0), atol=0.02)


@pytest.mark.usefixtures("known")
def test_the_gap_search_names_it(bench_logs):
    hidden = paper_model().with_effect("sensor_curvature", per_krpm=1.0)
    only = ("sensor_curvature", "speed_gain", "command_latency")
    options = GapOptions(only=only, max_effects=1, next_experiment=False)
    found = analyse(bench_logs(hidden), paper_model(), options)
    assert [effect.name for effect in found.effects] == ["sensor_curvature"]
    assert found.effects[0].parameters["per_krpm"].value == pytest.approx(1.0, abs=0.05)


@pytest.mark.usefixtures("known")
def test_a_certificate_plays_it():
    plant = next(one for one in robot_variants(paper_model()) if one.name == "with-sensor_curvature")
    assert plant.model.effects["sensor_curvature"] == {"per_krpm": 0.5}


@pytest.mark.usefixtures("known")
def test_the_table_of_the_documentation_lists_it():
    row = next(line for line in catalogue_table().splitlines() if "`sensor_curvature`" in line)
    assert "`per_krpm` (1/krpm; 0; 0 .. 3)" in row
    assert row.endswith("| yes | yes | yes |")
