"""Layouts of a study: how many runs, how often repeated, how long, and with which sampling."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Final

import numpy as np

from sysid.studies.zoo.drives.drive import Drive, Sensor


@dataclass(frozen=True)
class Layout:
    """One way to make a study."""

    name: str
    sequences: int
    """Command sequences; each is a group of repeats."""
    repeats: int
    seconds: float
    """Length of one run."""
    sample_s: float = 0.0
    """Sampling of the logs; 0: that of the drive."""
    encoder_step: float = 0.0
    """One count of the log's encoder over one sample, as a share of the top speed; 0: the drive's encoder."""

    def sensed(self, drive: Drive) -> Drive:
        """Return the drive with this layout's sensor; nominal and changed drive are logged alike."""
        sensor = drive.sensor
        if self.sample_s:
            sensor = dataclasses.replace(sensor, sample_s=self.sample_s)
        if self.encoder_step:
            sensor = _coarse(sensor, self.encoder_step * drive.top_rpm)
        return dataclasses.replace(drive, sensor=sensor)


def _coarse(sensor: Sensor, step_rpm: float) -> Sensor:
    """Return a sensor that counts over one sample, with a count worth `step_rpm`, and adds no other noise."""
    counts = max(1, round(60.0 / (step_rpm * sensor.sample_s)))
    return dataclasses.replace(sensor, counts=counts, window_s=0.0, noise_rpm=0.0, filter_s=0.0)


LAYOUTS: Final = (
    Layout("standard", sequences=8, repeats=3, seconds=2.5),
    Layout("few", sequences=3, repeats=2, seconds=2.5),
    Layout("no_repeats", sequences=10, repeats=1, seconds=2.5),
    Layout("one_recording", sequences=1, repeats=1, seconds=40.0),
    Layout("slow_log", sequences=6, repeats=2, seconds=4.0, sample_s=0.05),
    Layout("coarse_encoder", sequences=8, repeats=2, seconds=2.5, encoder_step=0.04),
)

STANDARD: Final = LAYOUTS[0]
"""The layout of every study that a model is fitted to, with the sensor of the case's layout."""

_SHARES: Final = (0.4, 0.12, 0.12, 0.12, 0.12, 0.12)


def draw_layout(rng: np.random.Generator) -> Layout:
    """Return a layout at random: two in five are standard."""
    return LAYOUTS[int(rng.choice(len(LAYOUTS), p=_SHARES))]


def layout_again(layout: Layout, fitted: Layout) -> Layout:
    """Return a layout's like for logs that drive the sequences of the `fitted` logs again.

    All of them, where each is driven once; else as many as the layout has, and each as often.
    """
    sequences = fitted.sequences if layout.repeats == 1 else min(layout.sequences, fitted.sequences)
    return dataclasses.replace(layout, sequences=sequences, seconds=fitted.seconds)
