"""Record what every program computes, and compare two such records number by number.

Example: python benchmarks/behaviour.py record out/before
         python benchmarks/behaviour.py compare out/before out/after

Record before a change that must not alter any result, and again after it. Programs are called by their
command lines and environments through Gymnasium, so that the same file runs before and after code has moved.
Recordings of real robots are included where MECANUM_REAL_LOGS names their folder.
"""

from __future__ import annotations

import filecmp
import hashlib
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from recordings import FOLDER
from tqdm import tqdm

ROOT: Final = Path(__file__).resolve().parents[1]
ENVIRONMENTS: Final = ("MecanumTankendo-v0", "MecanumTankendoTrack-v0", "MecanumTankendoDuel-v0")
MEASURED: Final = re.compile(
    r"seconds|_ms$|peak_memory|version|_us$|commit|python|sha256|timing|processor_s|wall_s|costs|comparisons"
)
"""Keys whose values depend on the machine, the clock or the checkout."""
USAGE: Final = "usage: python benchmarks/behaviour.py record FOLDER [NAME ...] | compare BEFORE AFTER"


def programs(out: Path) -> dict[str, list[str]]:
    """Return the command lines to record, by name, in an order in which each finds what it reads.

    Args:
        out: folder of the record.
    """
    fit, gap = str(out / "fit" / "model.json"), str(out / "gap" / "model.json")
    commands = {
        "fit": ["sysid.fit", "examples/logs", "--out", str(out / "fit")],
        "gap": ["sysid.gap", "examples/gap_logs", "--model", fit, "--out", str(out / "gap")],
        "gap_adopt": ["sysid.gap", "examples/gap_logs", "--model", fit, "--out", str(out / "gap_adopt"),
                          "--only", "weak_servo", "battery_sag", "--adopt"],
        "gap_none": ["sysid.gap", "examples/gap_logs", "--model", gap, "--out", str(out / "gap_none")],
        "online": ["sysid.online", "examples/logs", "--out", str(out / "online")],
        "reproduce": ["sysid.studies.reproduce", "--quick", "--out", str(out / "reproduce")],
        "certify": ["training.certify", "mpc", "--model", gap, "--episodes", "6", "--jobs", "2",
                    "--out", str(out / "certificate")],
        "compare": ["training.compare", "p", "retreat", "sidestep", "lqr", "smith", "oracle", "policy",
                    "--episodes", "8", "--no-rollers", "--jobs", "2", "--out", str(out / "compare" / "compare.json")],
        "train": ["training.train", "--out", str(out / "train"), "--steps", "6000"],
        "mjcf": ["mecanum_env.mjcf", gap, "--out", str(out / "mjcf")],
    }  # fmt: skip
    loop = out / "loop"
    commands["robot_gap"] = [
        "sysid.gap", str(loop / "robot"), "--model", fit, "--out", str(out / "robot_gap"), "--jobs", "2", "--only",
        "command_latency", "direction_asymmetry", "sensor_latency", "payload", "wheel_radius", "coulomb_friction",
    ]  # fmt: skip
    commands["robot_fit"] = ["sysid.fit", str(loop / "robot"), "--out", str(out / "robot_fit")]
    if (FOLDER / "robotino").is_dir():
        for name in ("micromouse/duty_right", "robotino/bench_without_integral/motor1", "husky/left"):
            short = name.replace("/", "_")
            commands[f"fit_{short}"] = [
                "sysid.fit",
                str(FOLDER / name),
                "--out",
                str(out / f"fit_{short}"),
            ]
            commands[f"gap_{short}"] = [
                "sysid.gap", str(FOLDER / name), "--model", str(out / f"fit_{short}" / "model.json"),
                "--out", str(out / f"gap_{short}"), "--seconds", "30", "--max-effects", "2",
            ]  # fmt: skip
        husky, fitted = FOLDER / "husky" / "body", str(out / "fit_husky_body" / "model.json")
        commands["fit_husky_body"] = [
            "sysid.fit", str(husky), "--robot", str(husky / "robot.json"), "--out", str(out / "fit_husky_body"),
        ]  # fmt: skip
        commands["gap_husky_body"] = [
            "sysid.gap", str(husky), "--model", fitted, "--plant", "planar", "--seconds", "15", "--max-effects", "2",
            "--out", str(out / "gap_husky_body"),
        ]  # fmt: skip
    return commands


def record(folder: Path, chosen: list[str]) -> None:
    """Run the programs and the environments; leave their JSON files, hashes and printed text in a folder.

    Args:
        folder: to write.
        chosen: names of programs; all where empty.
    """
    folder.mkdir(parents=True, exist_ok=True)
    out = folder.resolve()
    if not (out / "loop").exists():
        _python("-c", _WRITE_LOGS, str(out / "loop"), name="loop", out=out)
    commands = programs(out)
    for name in tqdm(chosen or [*commands, "rollouts"], unit="program", disable=None):
        if name == "rollouts":
            text = json.dumps(rollouts(out / "fit" / "model.json"), indent=1)
            (out / "rollouts.json").write_text(text, encoding="utf-8")
        else:
            _python("-m", *commands[name], name=name, out=out)
    shutil.rmtree(out / "loop" / "fit", ignore_errors=True)


_WRITE_LOGS: Final = """
import sys; from pathlib import Path; sys.path.insert(0, "examples")
import hidden_robot
hidden_robot.write_robot_logs(Path(sys.argv[1]) / "robot", "rollers")
"""


def _python(*arguments: str, name: str, out: Path) -> None:
    done = subprocess.run([sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, check=False)
    (out / f"{name}.txt").write_text(f"exit code {done.returncode}\n{done.stdout}", encoding="utf-8")
    if done.returncode not in (0, 1):
        print(f"{name}: exit code {done.returncode}\n{done.stderr[-2000:]}", file=sys.stderr)


def rollouts(model: Path) -> dict[str, str]:
    """Return a hash of everything that seeded episodes give, by environment and plant.

    Args:
        model: model file of a fit, whose uncertainty the randomised robots are drawn from.
    """
    import gymnasium

    found = {}
    for name in ENVIRONMENTS:
        for plant, randomize in (("planar", "none"), ("planar", "posterior"), ("rollers", "none")):
            env = gymnasium.make(f"mecanum_env:{name}", model=model, plant=plant, randomize=randomize)
            digest = hashlib.sha256()
            rng = np.random.default_rng(7)
            observation, _ = env.reset(seed=3)
            for _ in range(120):
                digest.update(observation.tobytes())
                observation, reward, terminated, truncated, _ = env.step(
                    rng.uniform(-1, 1, 3).astype(np.float32)
                )
                digest.update(np.float64(reward).tobytes())
                if terminated or truncated:
                    observation, _ = env.reset()
            env.close()
            found[f"{name} {plant} {randomize}"] = digest.hexdigest()
        many = gymnasium.make_vec(
            f"mecanum_env:{name}",
            num_envs=5,
            vectorization_mode="vector_entry_point",
            autoreset_mode="SameStep",
        )
        digest = hashlib.sha256(many.reset(seed=3)[0].tobytes())
        for _ in range(150):
            observation, reward, *_ = many.step(np.tile(rng.uniform(-1, 1, 3), (5, 1)).astype(np.float32))
            digest.update(observation.tobytes() + reward.tobytes())
        many.close()
        found[f"{name} vector"] = digest.hexdigest()
    return found


def leaves(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the path and value of every number, word and hash in a JSON value, except machine-dependent ones.

    Args:
        value: as `json` reads it.
        path: of the value.
    """
    if isinstance(value, dict):
        for key, inner in value.items():
            if not MEASURED.search(key):
                yield from leaves(inner, f"{path}/{key}")
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            yield from leaves(inner, f"{path}/{index}")
    else:
        yield path, value


def compare(before: Path, after: Path) -> int:
    """Print every difference between two records; return 1 where a number or a name differs, else 0.

    Sentences may be worded differently: they are counted, not compared.

    Args:
        before: the older record.
        after: the newer one.
    """
    different = reworded = equal = 0
    for old in sorted(before.rglob("*.json")):
        new = after / old.relative_to(before)
        if not new.exists():
            print(f"{new}: is missing")
            different += 1
            continue
        one, two = (dict(leaves(json.loads(path.read_text(encoding="utf-8")))) for path in (old, new))
        for path in sorted(one.keys() | two.keys()):
            a, b = one.get(path), two.get(path)
            if a == b:
                equal += 1
            elif all(isinstance(x, str) and (" " in x or "/" in x) for x in (a, b)):
                reworded += 1
            else:
                different += 1
                print(f"{old.relative_to(before)} {path}: {a!r} -> {b!r}")
    for pattern in ("*.xml", "*.csv", "policy.npz"):
        for old in sorted(before.rglob(pattern)):
            new = after / old.relative_to(before)
            same = _same_arrays if old.suffix == ".npz" else filecmp.cmp
            if new.exists() and same(old, new):
                equal += 1
            else:
                different += 1
                print(f"{old.relative_to(before)}: differs")
    print(f"{equal} values equal, {reworded} sentences worded differently, {different} values different")
    return int(different > 0)


def _same_arrays(one: Path, two: Path) -> bool:
    """Return whether two policy files hold the same weights; what else they say is about the run."""
    with np.load(one) as first, np.load(two) as second:
        numbers = [name for name in first.files if first[name].dtype.kind == "f"]
        return all(name in second.files and np.array_equal(first[name], second[name]) for name in numbers)


if __name__ == "__main__":
    if sys.argv[1:2] == ["record"] and len(sys.argv) > 2:
        record(Path(sys.argv[2]), sys.argv[3:])
    elif sys.argv[1:2] == ["compare"] and len(sys.argv) == 4:
        sys.exit(compare(Path(sys.argv[2]), Path(sys.argv[3])))
    else:
        sys.exit(USAGE)
