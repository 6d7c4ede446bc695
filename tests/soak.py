"""A soak: many episodes and a long random drive on rollers, with budgets for warnings and memory.

`python tests/soak.py --resets 10000 --minutes 60`; `tests/test_soak.py` runs a short one.
"""

import argparse
import ctypes
import gc
import resource
import sys
import warnings
from pathlib import Path

import numpy as np

from mecanum_env.model import paper_model
from mecanum_env.simulator import BodyCommands, drive
from mecanum_env.tankendo.env import TankendoEnv
from training.certify.plants import robot_variants

PIECE_S = 20.0
"""Length of one drive [s]."""


def resident() -> int:
    """Return the memory of this process [bytes] without what it has freed.

    The C library keeps freed memory for later, more of it or less as a drive left holes. That is no leak, so
    it is given back first.
    """
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def play(resets: int, steps: int = 10) -> int:
    """Play the beginning of many episodes with random actions; return the growth of memory [bytes]."""
    env = TankendoEnv(randomize="none")
    rng = np.random.default_rng(0)
    before = 0
    for episode in range(resets):
        observation, _ = env.reset(seed=episode)
        for _ in range(steps):
            observation, reward, ended, over, _ = env.step(rng.uniform(-1.0, 1.0, 3).astype(np.float32))
            assert np.isfinite(observation).all(), episode
            assert np.isfinite(reward), episode
            if ended or over:
                break
        if episode == resets // 10:
            before = resident()
    env.close()
    return resident() - before


def random_commands(rng: np.random.Generator, seconds: float) -> BodyCommands:
    """Return commands that jump about as no driver would."""
    count = int(seconds / 0.3)
    rows = np.column_stack(
        [
            np.arange(count) * 0.3,
            np.rint(rng.uniform(-135.0, 135.0, count)),
            np.rint(rng.uniform(-180.0, 180.0, count)),
            np.rint(rng.uniform(-100.0, 100.0, count)),
        ]
    )
    return BodyCommands(*rows.T)


def roam(minutes: float, piece_s: float = PIECE_S) -> tuple[int, int, int]:
    """Drive at random on rollers, each piece with the next effect; return pieces, effects, growth [bytes].

    The drive raises if a state is not finite, or MuJoCo warns.
    """
    rng = np.random.default_rng(0)
    variants = robot_variants(paper_model(), "rollers")
    pieces = max(2, round(minutes * 60.0 / piece_s))
    before, names = 0, set()
    for piece in range(pieces):
        variant = variants[piece % len(variants)]
        moved = drive(variant.model, random_commands(rng, piece_s), piece_s)
        assert np.isfinite(moved.qpos).all(), variant.name
        names.add(variant.name)
        del moved
        if piece == pieces // 10:
            before = resident()
    return pieces, len(names), resident() - before


def main() -> int:
    """Soak as long as the arguments say; exit code 1 beyond a budget."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--resets", type=int, default=10_000)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--budget-mib", type=float, default=16.0)
    given = parser.parse_args()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        played = play(given.resets) / 2**20
        pieces, effects, driven = roam(given.minutes)
    driven /= 2**20
    print(f"{given.resets} episodes: memory grew by {played:.1f} MiB")
    print(
        f"{pieces} drives of {PIECE_S:g} s on {effects} robots: memory grew by {driven:.1f} MiB; no warning"
    )
    return 0 if max(played, driven) <= given.budget_mib else 1


if __name__ == "__main__":
    sys.exit(main())
