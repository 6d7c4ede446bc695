"""Run the tests of the plugin with it compiled under the address and undefined-behaviour sanitizers.

`python tests/sanitized.py [PYTEST ARGUMENTS]`; exit code of pytest, or 1 if a sanitizer speaks.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import mujoco

from mecanum_env.plugin import sources_sha256

ROOT = Path(__file__).parents[1]
FLAGS = [
    "-std=c11",
    "-O1",
    "-g",
    "-fno-omit-frame-pointer",
    "-ffp-contract=off",
    "-fPIC",
    "-fvisibility=hidden",
    "-shared",
    "-fsanitize=address,undefined",
    "-fno-sanitize-recover=all",
]


def main(arguments: list[str]) -> int:
    """Copy the checkout, compile, and run the tests there."""
    compiler = os.environ.get("CC", "cc")
    package = Path(mujoco.__file__).parent
    library = next(package.glob("libmujoco.so.*"))
    with tempfile.TemporaryDirectory() as name:
        copy = Path(name)
        for part in ("mecanum_env", "sysid", "training", "tests", "assets"):
            shutil.copytree(ROOT / part, copy / part, ignore=shutil.ignore_patterns("*.so", "__pycache__"))
        shutil.copy(ROOT / "pyproject.toml", copy)
        plugin = copy / "mecanum_env" / "plugin"
        target = plugin / f"mecanum_wheel-mujoco-{mujoco.__version__}.so"
        sources = sorted(map(str, plugin.glob("*.c")))
        built = [f'-DSOURCES_SHA256="{sources_sha256()}"', f"-I{package / 'include'}"]
        subprocess.run(
            [compiler, *FLAGS, *built, *sources, str(library), "-lm", "-o", str(target)], check=True
        )
        preload = [
            subprocess.run(
                [compiler, f"-print-file-name=lib{kind}.so"], capture_output=True, text=True, check=True
            ).stdout.strip()
            for kind in ("asan", "ubsan")
        ]
        environment = os.environ | {
            "LD_PRELOAD": " ".join(preload),
            # Python itself never frees everything.
            "ASAN_OPTIONS": "detect_leaks=0:abort_on_error=0:exitcode=99",
            "UBSAN_OPTIONS": "print_stacktrace=1:halt_on_error=1",
            "PYTHONPATH": str(copy),
            "PYTHONMALLOC": "malloc",
        }
        chosen = arguments or ["tests/plugin", "tests/batch/test_runs.py"]
        done = subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *chosen],
            cwd=copy, env=environment, check=False,
        )  # fmt: skip
    return done.returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
