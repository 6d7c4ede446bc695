"""A gain that follows the logged voltage of the supply."""

import pytest

from mecanum_env.errors import InputError
from mecanum_env.model import Model
from sysid.gap import GapOptions, analyse
from sysid.gap.report.output import gap_json
from tests.gap.conftest import MakeLogs

QUIET = GapOptions(next_experiment=False)


@pytest.mark.parametrize("per_volt", [0.02, 0.08])
def test_a_hidden_loss_per_volt_is_named_with_its_size(base: Model, bench_logs: MakeLogs, per_volt: float):
    hidden = base.with_effect("battery_sag", "voltage", per_volt=per_volt)
    report = analyse(bench_logs(hidden, falls_v=3.0), base, QUIET)
    assert report.verdict == "named"
    (effect,) = gap_json(report)["effects"]
    assert (effect["name"], effect["form"]) == ("battery_sag", "voltage")
    assert effect["parameters"]["per_volt"]["value"] == pytest.approx(per_volt, abs=0.004)
    assert report.gap.after < 1.1 * report.gap.noise_floor


def test_a_changing_voltage_alone_is_no_gap(base: Model, bench_logs: MakeLogs):
    assert analyse(bench_logs(base, falls_v=3.0), base, QUIET).verdict == "no_gap"


def test_without_the_column_it_is_untestable_for_that_reason(base: Model, bench_logs: MakeLogs):
    report = analyse(bench_logs(base), base, GapOptions(only=("battery_sag",), next_experiment=False))
    (reason,) = [one.reason for one in report.untestable if one.name == "battery_sag/voltage"]
    assert reason == "these logs have no battery_v, which it follows: log it"
    with pytest.raises(
        InputError, match="only battery_sag/voltage: has no effect in bench logs without battery_v"
    ):
        analyse(bench_logs(base), base, GapOptions(only=("battery_sag/voltage",)))
