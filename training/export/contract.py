"""The contract of an exported policy: what goes in, what comes out, and which robots it was trained for.

It is a JSON object beside the exported files, and part of the ONNX file. `Contract.refuse` compares a model
with the robot of the training; the generated C header holds the same numbers and limits.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

import mecanum_env
from mecanum_env.effects.apply import active_effects
from mecanum_env.errors import InputError
from mecanum_env.law.metrics import law_step_metrics
from mecanum_env.model import Model, paper_model, read_model
from mecanum_env.tankendo import Sensors
from mecanum_env.tankendo.actions import FULL_V_RPM, FULL_VC_RPM
from mecanum_env.tankendo.observation import EXTRA_LIMIT, LIMITS, SIZE
from mecanum_env.units import RAD_S_PER_RPM
from training.controllers.features import FEATURE_NAMES, TIME_TO_CUT
from training.controllers.policy import Policy

FORMAT: Final = "mecanum-policy-contract/1"
_PACKAGED: Final = "the packaged model"
NUMBERS: Final = (
    ("opponent_x", "m", "position of the opponent, ahead"),
    ("opponent_y", "m", "position of the opponent, to the left"),
    ("opponent_vx", "m/s", "velocity of the opponent over the floor, ahead"),
    ("opponent_vy", "m/s", "velocity of the opponent over the floor, to the left"),
    ("tip_x", "m", "tip of its sword, ahead"),
    ("tip_y", "m", "tip of its sword, to the left"),
    ("tip_height", "m", "height of the tip over the floor"),
    ("tip_vx", "m/s", "velocity of the tip over the floor, ahead"),
    ("tip_vy", "m/s", "velocity of the tip over the floor, to the left"),
    ("tip_rising", "m/s", "velocity of the tip, upwards"),
    ("vx", "m/s", "own velocity, ahead"),
    ("vy", "m/s", "own velocity, to the left"),
    ("yaw_rate", "rad/s", "own yaw rate, counter-clockwise"),
    ("forward_share", "1", "V cos theta / full V of the command now held"),
    ("left_share", "1", "V sin theta / full V of the command now held"),
    ("turn_share", "1", "VC / full VC of the command now held"),
    ("x", "m", "own position in the field, from its centre"),
    ("y", "m", "own position in the field, from its centre"),
    ("heading_cos", "1", "cosine of the own heading in the field"),
    ("heading_sin", "1", "sine of the own heading in the field"),
    ("points", "1", "duel: points of the robot"),
    ("points_against", "1", "duel: points of the opponent"),
    ("striking", "1", "duel: 1 while the own sword strikes, else 0"),
)
"""Name, unit and meaning of each number of an observation, in their order."""
LIMITS_OF: Final[Mapping[str, tuple[float, str]]] = {
    "command_period_s": (1e-6, "s"),
    "command_quantum_rpm": (1e-6, "rpm"),
    "top_speed_m_s": (0.1, "m/s"),
    "lever_m": (0.1, "m"),
    "rise_time_s": (0.25, "s"),
}
"""What a robot is compared by: relative deviation up to which a policy drives it, and unit. This project's
choice: a tenth is what two robots of one drawing differ by, and a quarter of the rise time is 0.03 s, less
than a third of the shortest delay that costs a policy fights."""


@dataclass(frozen=True)
class Contract:
    """What an exported policy takes, gives, and was trained for."""

    policy: Policy
    name: str
    """File of the policy, as it was given."""
    figures: Mapping[str, float]
    """`robot_figures` of the robot that it was trained on."""
    effects: Mapping[str, Mapping[str, float]]
    """Effects of that robot."""
    randomized: str
    """How robots of the training differed from it; "none": they did not."""

    def differences(self, model: Model, *, compensated: bool = False) -> list[str]:
        """Return in words what of a model the policy was not trained for; empty: nothing.

        Effects of a model count unless the robots of the training differed, or the controller is
        `compensated`.
        """
        found = []
        for name, value in robot_figures(model).items():
            share, unit = LIMITS_OF[name]
            wanted = self.figures[name]
            if abs(value - wanted) > share * abs(wanted):
                percent = f" within {share:.0%}" if share > 1e-3 else ""
                found.append(f"{name} = {value:.4g} {unit}, must be {wanted:.4g} {unit}{percent}")
        if not compensated and self.randomized == "none":
            names = [effect.name for effect, _ in active_effects(model)]
            names += [f"custom effect ({one.station})" for one in model.custom]
            found += [f"effect {name}, must be none" for name in names if name not in self.effects]
        return found

    def refuse(self, model: Model, source: str, *, compensated: bool = False) -> None:
        """Refuse a model that the policy was not trained for.

        The `source` of the model is named in the message; `compensated` is that of `differences`.

        Raises:
            InputError: it differs; the message says by what, and what would be right.
        """
        found = self.differences(model, compensated=compensated)
        if found:
            hint = (
                "; add +compensated, or train on it"
                if any("effect" in one for one in found)
                else "; train on it"
            )
            raise InputError(f"{self.name} was not trained for {source}: {'; '.join(found)}{hint}")

    def to_json(self) -> dict[str, Any]:
        """Return the contract as a JSON object."""
        network = self.policy.network
        size = network.observation_size
        limits = [*LIMITS.tolist(), *[EXTRA_LIMIT] * (size - SIZE)]
        numbers = [
            {"index": i, "name": name, "unit": unit, "low": -limits[i], "high": limits[i], "meaning": meaning}
            for i, (name, unit, meaning) in enumerate(NUMBERS[:size])
        ]
        return {
            "format": FORMAT,
            "version": mecanum_env.__version__,
            "policy": Path(self.name).name,
            "weights_sha256": weights_digest(self.policy),
            "env": self.policy.about.get("env", ""),
            "observation": {
                "size": size,
                "stack": network.stack,
                "order": "oldest first; at the start of a fight the first observation is repeated",
                "frame": "the robot's: x ahead, y to the left; velocities are over the floor",
                "age_s": Sensors.delay_s,
                "numbers": numbers,
            },
            "features": [
                *FEATURE_NAMES,
                *(one[0] for one in NUMBERS[10:size]),
                *([TIME_TO_CUT] if network.has_time_to_cut else []),
            ],
            "maai_m": self.policy.maai_m,
            "scaling": {
                "formula": "clip((features - mean) / scale, -clip, clip)",
                "mean": network.mean.tolist(),
                "scale": network.scale.tolist(),
                "clip": network.clip,
            },
            "action": {
                "size": 3,
                "low": -1.0,
                "high": 1.0,
                "mode": network.action_mode,
                "full_v_rpm": FULL_V_RPM,
                "full_vc_rpm": FULL_VC_RPM,
            },
            "command": {"numbers": ["V [rpm]", "theta [deg]", "VC [rpm]"], "whole_numbers": True},
            "trained_for": {
                **self.figures,
                "effects": {name: dict(values) for name, values in self.effects.items()},
                "randomized": self.randomized,
                "tolerances": {name: share for name, (share, _) in LIMITS_OF.items()},
            },
        }


def contract_of(policy: Policy, name: str, model: Model | None = None) -> Contract:
    """Return the contract of a policy from the file `name`.

    Args:
        policy: as `load_policy` returned it.
        name: file of the policy.
        model: the robot that it was trained on; by default the one that the policy's file names.

    Raises:
        InputError: the policy's file names a model file that is not there, and none was given.
    """
    known = policy.about.get("model", {})
    if model is None:
        source = known.get("source", _PACKAGED)
        if source == _PACKAGED:
            model = paper_model()
        elif Path(source).is_file():
            model = read_model(source)
        else:
            raise InputError(f"{name}: trained on {source}, which is not there; give it by --model")
    randomized = policy.about.get("settings", {}).get("randomize", "none")
    return Contract(policy, name, robot_figures(model), model.effects, str(randomized))


def robot_figures(model: Model) -> dict[str, float]:
    """Return what a policy's motion depends on, by the names of `LIMITS_OF`.

    The top speed is that of the wheels' rims, the lever that by which wheel speeds turn the body, and the
    rise time that of the wheel law from 10 to 90 % of a step.
    """
    wheel, robot = model.wheel, model.robot
    ceiling = min(wheel.saturation_rpm, FULL_V_RPM)
    return {
        "command_period_s": wheel.command_period_s,
        "command_quantum_rpm": wheel.command_quantum_rpm,
        "top_speed_m_s": ceiling * RAD_S_PER_RPM * robot.wheel_radius_m,
        "lever_m": robot.half_wheelbase_m + robot.half_track_m,
        "rise_time_s": law_step_metrics(model.wheel.law).rise_time_s,
    }


def weights_digest(policy: Policy) -> str:
    """Return the SHA-256 of a policy's normaliser and weights, which tells two policies apart."""
    network = policy.network
    digest = hashlib.sha256()
    for array in (network.mean, network.scale, *network.weights, *network.biases):
        digest.update(np.ascontiguousarray(array, "<f8").tobytes())
    return digest.hexdigest()
