"""Findings: what a user should know about a log although it is not an error.

A finding is a record of what was seen. Its sentence is made here, from the record's fields, and nowhere else.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

KINDS: Final[Mapping[str, str]] = {
    "uneven_stamps": "the time between samples varies",
    "gap": "samples are missing for a while",
    "held_samples": "a sensor slower than the log: samples repeat the one before while the wheel moves",
    "missing": "empty cells",
    "stuck": "a channel that does not move",
    "same_channel": "two channels hold the same numbers: one sensor, not two",
    "units": "a column that looks as if it had another unit or sign",
    "fast_commands": "commands that change sooner than the robot takes them",
    "beyond_limit": "speeds above the 135 rpm of the paper's robot",
    "not_at_rest": "a run that starts moving",
    "late_command": "no command in the first rows",
    "late_rows": "commands that stand a row later than they were sent",
    "group": "a run unlike the others of its group",
    "split": "what is, or is not, held out",
    "unlisted": "a file that dataset.toml does not list",
}
"""Every kind of finding and its meaning."""

_GAIN: Final = "{channel} is {value:.3g} times the settled command: "
_SENTENCES: Final[Mapping[str, str]] = {
    "uneven_stamps": "{channel}: intervals of {low_ms:.3g} to {high_ms:.3g} ms (5 to 95 percent), "
    "median {median_ms:.3g} ms",
    "gap": "{channel}: {count} gap(s), the longest {value:.3g} s; the median interval is {median_s:.3g} s",
    "held_samples": "{channel}: {percent:.0f} % of the samples repeat the one before while it changes",
    "missing": "{channel}: {percent:.3g} % of the samples are missing",
    "stuck": "{channel}: {value:g} in every sample",
    "stuck for a while": "{channel}: {level:g} from {from_s:.3g} to {to_s:.3g} s",
    "same_channel": "{channel} repeats {other}: one sensor, not two",
    "stamps": "{channel} has whole numbers only; {unit}? (scale = {scale:g})",
    "radians": "{channel} is at most {value:.4g}; radians? (scale = 57.29577951308232)",
    "degrees": "{channel} reaches {value:.3g}; degrees per second? (scale = 0.017453292519943295)",
    "gain": _GAIN + "{suspect} in {unit}? (scale = {scale:.9g})",
    "sign": _GAIN + "is the sign reversed? (scale = -1)",
    "no speed": _GAIN + "is {suspect} a duty, a voltage or a motor's speed? (scale = {scale:.4g})",
    "whole in rpm": "{channel} has whole numbers of rpm in rad/s; rad/s? (scale = {scale:.9g})",
    "fast_commands": "{value:.0f} of {changes} command changes come within {period_s:g} s of the one before",
    "beyond_limit": "{quantity} up to {value:.4g} rpm, above {limit_rpm:g}",
    "not_at_rest": "{channel} starts at {value:.3g}",
    "late_command": "{channel} first appears after {value:.3g} s; taken as 0 until then",
    "group": 'the commands differ from those of the first run in its group "{group}": it is no repeat',
    "late_rows": "{channel} has moved in the row that first shows the command in {count} of {changes} "
    "changes: write each command in the row after which it was sent",
    "one run": "one run only: it is used for {split}, and nothing is held out to check the result",
    "no run": "no run is for {split}",
    "shared groups": "{value:.0f} group(s) are both fitted and held out ({groups}): "
    "held-out repeats test the noise, not new commands",
    "unlisted": "not listed in dataset.toml; read all the same",
}
"""Sentence of each kind, or of each variant where a kind has several."""


@dataclass(frozen=True)
class Finding:
    """Something noticed in a log that is not an error but that a user should know."""

    file: str
    """Run it concerns; empty if it concerns the whole dataset."""
    kind: str
    """One of `KINDS`."""
    value: float
    """The quantity that was found; its unit is in the sentence."""
    channel: str = ""
    """Column it concerns, if it concerns a single one."""
    variant: str = ""
    """Which sentence of the kind applies, where there are several."""
    details: Mapping[str, float | str] = field(default_factory=dict)
    """Whatever else the sentence states."""

    @property
    def message(self) -> str:
        """The finding as one sentence, without the file's name."""
        return _SENTENCES[self.variant or self.kind].format(
            channel=self.channel, value=self.value, percent=100.0 * self.value, **self.details
        )

    def to_json(self) -> dict[str, str | float]:
        """Return the finding as `fit.json` and `gap.json` list it."""
        return {"file": self.file, "kind": self.kind, "message": self.message, "value": self.value}
