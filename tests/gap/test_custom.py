"""Custom effects from logs: a hidden term is proposed, adopting it closes the gap on unseen runs."""

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import CustomEffect, read_model, write_model
from sysid.compare.least_squares import ResidualProblem
from sysid.compare.model_error import Whitener
from sysid.compare.predicted import SimulationSettings
from sysid.gap import GapOptions, analyse, gap_table
from sysid.gap.report.output import gap_json
from sysid.gap.search.custom import propose
from sysid.gap.search.study_data import study_data
from sysid.gap.search.terms import Extent, Formula, Term, tables_at, terms_at

EXTENT = Extent(
    120.0, 2.0, (("command_rpm", -120.0, 120.0), ("speed_rpm", -118.0, 119.0), ("time_s", 0.0, 2.0))
)
FEW = GapOptions(only=("battery_sag",), next_experiment=False)


@pytest.fixture(scope="module")
def proposed(base, bench_logs):
    """Return a function from a hidden custom effect, and the model of the study, to the proposal."""

    def of(*hidden: CustomEffect, model=base, seed: int = 1):
        logs = bench_logs(model.with_custom(*hidden), seed=seed)
        data = study_data(logs, model, GapOptions())
        whitener = Whitener(data.observations, data.noise, data.error)
        return propose(ResidualProblem(model, whitener, SimulationSettings()))

    return of


@pytest.mark.parametrize(
    ("station", "formula"),
    [
        ("load", "-0.08 * speed * sin(3 * angle)"),
        ("load", "-0.0006 * speed * abs(speed)"),
        ("load", "3 * sign(speed) * exp(-abs(speed) / 15)"),
        ("set_point", "4 * sign(command)"),
        ("sensor", "3 * sin(2 * angle + 0.5)"),
        ("sensor", "-0.0006 * speed * abs(speed)"),
    ],
)
def test_a_hidden_term_is_found_at_its_station_with_its_size(proposed, station, formula):
    found = proposed(CustomEffect(station, formula))
    assert station in (found.effect.station, *found.stations_tied)
    given = {name: np.linspace(low, high, 101) for name, low, high in (
        ("command", -110.0, 110.0), ("speed", -100.0, 100.0), ("angle", 0.0, 40.0)
    )}  # fmt: skip
    truth = CustomEffect(station, formula).value(given)
    error = found.effect.value(given) - truth
    assert np.sqrt(np.mean(error**2)) < 0.1 * np.sqrt(np.mean(truth**2))
    assert len(found.effect.formula) < len(formula) + 15  # as short as the truth


def test_nothing_is_proposed_where_nothing_is_hidden(proposed):
    assert all(proposed(seed=seed) is None for seed in range(5))


def test_two_terms_are_found_together(proposed):
    found = proposed(CustomEffect("load", "2 * sign(speed) + 0.05 * speed * sin(angle)"))
    assert "sign(speed)" in found.effect.formula
    assert "speed * sin(angle" in found.effect.formula


def test_what_no_formula_of_the_library_gives_becomes_a_table(proposed):
    found = proposed(CustomEffect("set_point", "5 * sin(command / 20)"))
    assert found.effect.station == "set_point"
    assert found.effect.table.input == "command"


def test_a_second_custom_effect_is_found_beside_the_first(proposed, base):
    first = base.with_custom(CustomEffect("load", "2 * sin(angle)"))
    found = proposed(CustomEffect("load", "-0.0006 * speed * abs(speed)"), model=first)
    assert "speed * abs(speed)" in found.effect.formula


def test_the_study_proposes_and_only_adopts_when_asked(base, bench_logs, tmp_path):
    hidden = base.with_custom(CustomEffect("load", "-0.08 * speed * sin(3 * angle)"))
    logs = bench_logs(hidden, seed=2)
    asked = analyse(logs, base, FEW)
    assert asked.verdict == "unexplained"
    # Only what the study spent is added to it.
    assert replace(asked.model, provenance=base.provenance) == base
    assert set(asked.model.provenance) - set(base.provenance) == {"studies"}
    assert asked.gap.after == asked.gap.before
    assert asked.custom.after < 0.25 * asked.gap.before
    value = gap_json(asked)
    assert value["custom"][0]["station"] == "load"
    assert value["custom"][0]["source"] == "gap"
    assert value["custom_evidence"]["adopted"] is False
    assert "--adopt adds it to the model" in gap_table(asked)

    adopted = analyse(logs, base, replace(FEW, adopt=True))
    assert adopted.verdict == "unexplained"
    assert adopted.unseen
    assert adopted.gap.after == adopted.custom.after
    assert adopted.gap.after < 1.1 * adopted.gap.noise_floor
    write_model(adopted.model, tmp_path / "model.json")
    assert read_model(tmp_path / "model.json").custom == (adopted.custom.effect,)
    # The new model is a model like any other: other logs of the same wheel show no gap.
    again = analyse(bench_logs(hidden, seed=9), adopted.model, FEW)
    assert again.verdict == "no_gap"


@pytest.mark.parametrize("station", ["command", "set_point", "load", "sensor"])
def test_every_term_and_table_is_a_formula_that_models_may_hold(base, station):
    for term in terms_at(station, EXTENT):
        formula = Formula(station, (term,), EXTENT.top_rpm)
        assert formula.parameter_count == term.count + (term.shape > 0.0)
        assert formula.model(base, formula.start()).custom[0].station == station
    assert {table.input for table in tables_at(station, EXTENT)} <= {"command", "speed", "time"}


def test_a_wave_is_written_with_amplitude_and_phase():
    wave = Term("speed * wave", 120.0, harmonic=3)
    assert wave.written((0.08, 0.0), 0.0, 4) == "0.08 * speed * sin(3 * angle)"
    assert wave.written((-0.08, 0.00001), 0.0, 4) == "-0.08 * speed * sin(3 * angle)"
    assert wave.written((0.03, -0.04), 0.0, 4) == "0.05 * speed * sin(3 * angle - 0.927)"
    assert Term("wave", 1.0, harmonic=1).written((0.0, 2.0), 0.0, 4) == "2 * sin(angle + 1.571)"


def test_three_of_the_longest_terms_fit_into_a_program():
    terms = tuple(Term("speed * wave", 120.0, harmonic) for harmonic in (10, 11, 12))
    effect = Formula("load", terms, 120.0).effect([-0.012345678901234] * 6)
    assert len(effect.program) <= 48
