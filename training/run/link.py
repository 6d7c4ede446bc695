"""A bad link in one direction: late, uneven, and with packets that never arrive."""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np

from mecanum_env.errors import InputError


@dataclass(frozen=True)
class LinkQuality:
    """How bad a link is, each way."""

    latency_s: float = 0.0
    """Time that every packet takes [s]."""
    jitter_s: float = 0.0
    """Mean of what comes on top, exponentially distributed [s]; packets may overtake each other."""
    loss: float = 0.0
    """Share of packets that never arrive."""

    def __post_init__(self) -> None:
        if not (self.latency_s >= 0.0 and self.jitter_s >= 0.0 and 0.0 <= self.loss < 1.0):
            raise InputError(
                f"link: latency {self.latency_s:g} s, jitter {self.jitter_s:g} s, loss {self.loss:g}; "
                "must be at least 0 s, at least 0 s, and from 0 to below 1"
            )


class Link:
    """One direction of a link; chance follows from `rng`."""

    def __init__(self, quality: LinkQuality, rng: np.random.Generator) -> None:
        self._quality, self._rng = quality, rng
        self._under_way: list[tuple[float, int, bytes]] = []
        self._count = 0

    def put(self, packet: bytes, now_s: float) -> None:
        """Give a packet to the link at a time [s]."""
        quality = self._quality
        if quality.loss and self._rng.random() < quality.loss:
            return
        late_s = quality.latency_s + (self._rng.exponential(quality.jitter_s) if quality.jitter_s else 0.0)
        self._count += 1
        heapq.heappush(self._under_way, (now_s + late_s, self._count, packet))

    def due(self, now_s: float) -> list[bytes]:
        """Return the packets that have arrived by a time [s], in the order of their arrival."""
        arrived = []
        while self._under_way and self._under_way[0][0] <= now_s:
            arrived.append(heapq.heappop(self._under_way)[2])
        return arrived

    @property
    def next_s(self) -> float:
        """When the next packet arrives [s]; infinite while none is under way."""
        return self._under_way[0][0] if self._under_way else float("inf")
