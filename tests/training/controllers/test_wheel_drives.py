"""Four drives at once: each receives what it would receive alone."""

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.effects.apply import drive_parameters
from mecanum_env.kinematics import WHEELS
from mecanum_env.model import CustomEffect, paper_model
from mecanum_env.model.static_map import map_parameters
from mecanum_env.wheel_drive.drive import shaped_command
from training.controllers.wheel_drives import WheelDrives

EFFECTS = {
    "no effect": {},
    "wheels that differ": {"wheel_gain_mismatch": {"gain_fl": 0.85, "gain_rr": 1.1}},
    "a dead band on different wheels": {
        "wheel_gain_mismatch": {"gain_fl": 0.85},
        "command_deadband": {"threshold_rpm": 20.0},
        "direction_asymmetry": {"reverse_ratio": 0.8},
    },
    "a map on different wheels": {
        "wheel_gain_mismatch": {"gain_fr": 0.9},
        "static_map": map_parameters([6.0, 30.0, 70.0], [2.0, 20.0, 80.0]),
    },
    "a sagging supply": {
        "wheel_gain_mismatch": {"gain_rl": 0.9},
        "speed_saturation/supply": {"limit_rpm": 60.0},
        "battery_sag": {"drop_per_s": 0.04},
    },
}


@pytest.mark.parametrize("name", EFFECTS)
@pytest.mark.parametrize("custom", [(), (CustomEffect("command", "2 * sign(command)"),)])
def test_each_drive_receives_what_it_would_alone(name, custom):
    model = replace(paper_model(), effects=EFFECTS[name], custom=custom)
    wheels = np.random.default_rng(0).uniform(-150.0, 150.0, (4, 30))
    for given in (wheels, wheels[:, 0]):
        found = WheelDrives.of(model).received(given, 1.5)
        for k, wheel in enumerate(WHEELS):
            drive = drive_parameters(model, wheel)
            alone = np.clip(shaped_command(drive, given[k], 1.5), -drive.supply_rpm, drive.supply_rpm)
            np.testing.assert_array_equal(found[k], alone)
