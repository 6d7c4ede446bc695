"""How each effect is measured by itself, without driving: for candidates that no command separates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from mecanum_env.effects import CATALOGUE
from sysid.gap.report.wording import listed

_GROUPS: Final[Mapping[str, tuple[str, ...]]] = {
    "the wheels' speeds": ("speed_fl_rpm", "speed_fr_rpm", "speed_rl_rpm", "speed_rr_rpm"),
    "the body's velocity": ("vx_m_s", "vy_m_s", "yaw_rate_rad_s"),
    "the pose": ("x_m", "y_m", "yaw_rad"),
}


def what_to_measure(sets: Sequence[Sequence[str]], channels: Sequence[str]) -> str:
    """Return, as the end of a sentence, what besides `channels` would tell sets of effects apart.

    Args:
        sets: names of effects; what they share is no matter.
        channels: measured so far.
    """
    shared = set(sets[0]).intersection(*sets[1:])
    differing = [CATALOGUE[n] for names in sets for n in names if n not in shared and n in CATALOGUE]
    checks = dict.fromkeys(effect.direct_check for effect in differing if effect.direct_check)
    missing = [what for what, names in _GROUPS.items() if not set(names) & set(channels)]
    if tuple(channels) == ("speed_rpm",):
        missing = ["the body of the whole robot on the floor"]
    ways = [f"measure {'; or '.join(checks)}"] if checks else []
    ways += [f"log {listed(missing)} too"] if missing else []
    return "; or ".join(ways) if ways else "measure with a second, independent sensor"
