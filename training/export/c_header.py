"""A policy as one C header without dependencies, for a robot's own processor."""

from __future__ import annotations

from pathlib import Path
from string import Template
from typing import Final

import numpy as np

from mecanum_env.tankendo.actions import FULL_V_RPM, FULL_VC_RPM, ActionMode
from mecanum_env.tankendo.constants import GUARD_TIP_M
from mecanum_env.tankendo.sword import GUARD_HEIGHT_M
from mecanum_env.units import FloatArray
from training.controllers.features import (
    DRAWN_SHARE,
    FAR_S,
    LEAST_RATE_PER_S,
    LEAST_SHARE,
    WAY_DIRECTIONS,
    WAY_LENGTHS_M,
)
from training.controllers.policy import Network, Policy
from training.export.contract import LIMITS_OF, Contract, weights_digest

_TEMPLATE: Final = Path(__file__).parent / "policy.h.in"
_COMMANDS: Final[dict[ActionMode, str]] = {
    "cartesian": (
        "  const MECANUM_REAL length = sqrt(action[0] * action[0] + action[1] * action[1]);\n"
        "  const MECANUM_REAL v = $v * (length > 1 ? 1 : length);\n"
        "  const MECANUM_REAL theta = atan2(action[1] + 0.0, action[0] + 0.0) * $degrees;"
    ),
    "polar": (
        "  const MECANUM_REAL v = $v * 0.5 * (action[0] + 1);\n  const MECANUM_REAL theta = 180 * action[1];"
    ),
    "command": "  const MECANUM_REAL v = $v * action[0];\n  const MECANUM_REAL theta = 180 * action[1];",
}
"""C code that turns an action of each mode into V and theta, as `mecanum_env.tankendo.actions` does."""

_TIME_TO_CUT: Final = """\
  /* How long the sword still rises, by the way of its tip in the technique that fits best. */
  static const double ways[$numbers] = {$ways};
  static const double lengths[$count] = {$lengths};
  const MECANUM_REAL away = sqrt(tip_x * tip_x + tip_y * tip_y), least = (MECANUM_REAL)1e-6;
  const MECANUM_REAL drawing = (f[8] * tip_x + f[9] * tip_y) / (away > least ? away : least);
  int technique = 0;
  MECANUM_REAL way = 0;
  for (int i = 0; i < $count; ++i) {
    const MECANUM_REAL there = drawn * (MECANUM_REAL)ways[2 * i] + raised * (MECANUM_REAL)ways[2 * i + 1];
    if (i == 0 || there > way) {
      way = there;
      technique = i;
    }
  }
  const MECANUM_REAL length = (MECANUM_REAL)lengths[technique];
  const MECANUM_REAL share = way / length;
  const MECANUM_REAL rate = (drawing * (MECANUM_REAL)ways[2 * technique] +
                             f[10] * (MECANUM_REAL)ways[2 * technique + 1]) / length;
  if (share > (MECANUM_REAL)$least_share && rate > (MECANUM_REAL)$least_rate) {
    const MECANUM_REAL part = share > 1 ? 1 : share;
    const MECANUM_REAL elapsed = (MECANUM_REAL)0.5 - sin(asin(1 - 2 * part) / 3);
    const MECANUM_REAL left = 6 * elapsed * (1 - elapsed) * (1 - elapsed) / rate;
    f[$place] = left < (MECANUM_REAL)$far ? left : (MECANUM_REAL)$far;
  } else {
    f[$place] = share > (MECANUM_REAL)$drawn_share ? 0 : (MECANUM_REAL)$far;
  }
"""


def c_header(contract: Contract) -> str:
    """Return the text of the header of a contract's policy."""
    policy, network = contract.policy, contract.policy.network
    size, features = network.observation_size, network.feature_count
    arrays = [
        _array("mean", network.mean, "double"),
        _array("scale", network.scale, "double"),
    ]
    layers = []
    source, target = "a", "b"
    for layer, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        arrays += [_array(f"weight_{layer}", weight, "float"), _array(f"bias_{layer}", bias, "float")]
        layers.append(_layer(network, layer, source, target))
        source, target = target, source
    clipped = f"{source}[i] > 1 ? 1 : {source}[i] < -1 ? -1 : {source}[i]"
    widest = max(len(network.mean), *(len(bias) for bias in network.biases))
    return Template(_TEMPLATE.read_text(encoding="utf-8")).substitute(
        title=f"{Path(contract.name).name}, trained for {policy.about.get('env', 'an unnamed task')}",
        digest=weights_digest(policy),
        period=f"{contract.figures['command_period_s']:g}",
        size=size,
        features=features,
        stack=network.stack,
        widest=widest,
        trained=", ".join(_real(contract.figures[name]) for name in LIMITS_OF),
        tolerance=", ".join(_real(share) for share, _ in LIMITS_OF.values()),
        guard_tip=_real(GUARD_TIP_M),
        guard_height=_real(GUARD_HEIGHT_M),
        maai=_real(policy.maai_m),
        time_to_cut=_time_to_cut(size) if network.has_time_to_cut else "",
        clip=_real(network.clip),
        arrays="\n".join(arrays),
        layers="\n".join(layers),
        squash=f"tanh({source}[i])" if network.squashes else clipped,
        command=_command(policy),
    )


def _time_to_cut(size: int) -> str:
    """Return the C code of the last feature, `training.controllers.features.time_to_cut`."""
    ways = ", ".join(_real(number) for row in WAY_DIRECTIONS.tolist() for number in row)
    lengths = ", ".join(_real(length) for length in WAY_LENGTHS_M.tolist())
    return Template(_TIME_TO_CUT).substitute(
        ways=ways,
        lengths=lengths,
        count=len(WAY_LENGTHS_M),
        numbers=2 * len(WAY_LENGTHS_M),
        least_share=_real(LEAST_SHARE),
        least_rate=_real(LEAST_RATE_PER_S),
        drawn_share=_real(DRAWN_SHARE),
        far=_real(FAR_S),
        place=size + 1,
    )


def _layer(network: Network, layer: int, source: str, target: str) -> str:
    """Return the C code of a layer of a network, from the array `source` to the array `target`."""
    outputs, inputs = network.weights[layer].shape
    activation = {"tanh": "tanh(sum)", "relu": "sum > 0 ? sum : 0"}[network.activation]
    return (
        f"  for (int i = 0; i < {outputs}; ++i) {{\n"
        f"    MECANUM_REAL sum = (MECANUM_REAL)mecanum_policy_bias_{layer}[i];\n"
        f"    for (int j = 0; j < {inputs}; ++j) {{\n"
        f"      sum += (MECANUM_REAL)mecanum_policy_weight_{layer}[i * {inputs} + j] * {source}[j];\n"
        "    }\n"
        f"    {target}[i] = {'sum' if layer == len(network.weights) - 1 else activation};\n"
        "  }"
    )


def _command(policy: Policy) -> str:
    """Return the C code that turns an action of a policy into its command, rounded as the robot takes it."""
    spoken = Template(_COMMANDS[policy.network.action_mode]).substitute(
        v=_real(FULL_V_RPM), degrees=_real(float(np.rad2deg(1.0)))
    )
    return (
        f"{spoken}\n"
        f"  const MECANUM_REAL turn = {_real(FULL_VC_RPM)} * action[2];\n"
        f"  const MECANUM_REAL quantum = {_real(policy.quantum_rpm)};\n"
        "  /* Halves go to the even neighbour, as in the processor's default rounding mode. */\n"
        "  command[0] = (int)rint(rint(v / quantum) * quantum);\n"
        "  command[1] = (int)rint(theta);\n"
        "  command[2] = (int)rint(rint(turn / quantum) * quantum);"
    )


def _real(value: float) -> str:
    """Return a number as a C constant that reads back equal."""
    text = repr(float(value))
    return text if any(mark in text for mark in ".en") else f"{text}.0"


def _array(name: str, values: FloatArray, kind: str) -> str:
    """Return a constant C array; weights are floats, in which they were trained and stored."""
    if kind == "float":
        numbers = [f"{_real(float(np.format_float_scientific(v)))}f" for v in np.float32(values).ravel()]
    else:
        numbers = [_real(v) for v in values.ravel().tolist()]
    rows = [", ".join(numbers[i : i + 6]) for i in range(0, len(numbers), 6)]
    body = ",\n    ".join(rows)
    return f"static const {kind} mecanum_policy_{name}[{len(numbers)}] = {{\n    {body}}};\n"
