"""How fast pictures are drawn: light and full quality, with OSMesa and EGL, each in its own process.

Drawn is the packaged robot at 640 x 480 with caption and H.264 encoding, as by
`python -m mecanum_env.render`. Frames per second are those of the fastest run, without the first frame, which
also sets up the renderer. Processor time per frame depends less on the load of the machine.

    python benchmarks/render.py --out out/benchmark_render.json
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tqdm import tqdm

from mecanum_env.cli import run
from mecanum_env.files import write_json
from mecanum_env.rendering.backend import library_loads
from mecanum_env.rendering.view import Frame

BACKENDS = ("osmesa", "egl")
QUALITIES = ("light", "full")


def benchmark(frames: int = 60, repeats: int = 5, out: Path | None = None) -> None:
    """Print frames per second of light and full quality under OSMesa and EGL; write JSON with --out.

    Example: python benchmarks/render.py --frames 60

    Args:
        frames: pictures per run.
        repeats: number of runs, of which the fastest counts.
        out: JSON file to write.
    """
    results: list[dict[str, Any]] = []
    cases = [(backend, quality) for backend in BACKENDS for quality in QUALITIES]
    for backend, quality in tqdm(cases, leave=False, disable=None):
        if not library_loads(backend):
            results.append({"backend": backend, "quality": quality, "missing": True})
            continue
        done = subprocess.run(
            [sys.executable, __file__, "--one", quality, str(frames), str(repeats)],
            env={**os.environ, "MUJOCO_GL": backend},
            capture_output=True,
            text=True,
            check=True,
        )
        results.append({"backend": backend, "quality": quality, **json.loads(done.stdout)})
    _print(results)
    if out is not None:
        write_json(out, {"format": "mecanum-benchmark-render/1", "cpus": os.cpu_count(), "results": results})


def one(quality: str, frames: int, repeats: int) -> dict[str, Any]:
    """Draw and encode in this process; return frames per second, processor time per frame and geoms."""
    import mujoco

    from mecanum_env.model import paper_model
    from mecanum_env.rendering.video import frame_rows, render_frames, write_video
    from mecanum_env.rendering.view import View
    from mecanum_env.simulator import drive, scripted

    trajectory = drive(paper_model(), scripted("tour")[0], frames / 30.0)
    rows = frame_rows(trajectory.time_s)[:frames]
    view = View(quality="light" if quality == "light" else "full")
    setup, seconds, processor = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(repeats):
            after_first: list[tuple[float, float]] = []
            began = time.perf_counter()
            write_video(Path(folder) / "a.mp4", _marked(render_frames(trajectory, view, rows), after_first))
            setup.append(after_first[0][0] - began)
            seconds.append(time.perf_counter() - after_first[0][0])
            processor.append(_processor_s() - after_first[0][1])
    return {
        "mujoco": mujoco.__version__,
        "frames": len(rows),
        "fps": (len(rows) - 1) / min(seconds),
        "processor_ms_per_frame": 1e3 * min(processor) / (len(rows) - 1),
        "first_frame_s": min(setup),
        "geoms": int(trajectory.mj_model.ngeom),
    }


def _marked(frames: Iterator[Frame], marks: list[tuple[float, float]]) -> Iterator[Frame]:
    """Yield the frames; after each, append the clock and the processor time [s] to `marks`."""
    for frame in frames:
        yield frame
        marks.append((time.perf_counter(), _processor_s()))


def _processor_s() -> float:
    """Return the processor time [s] of this process, its threads and the encoder that it waited for."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


def _print(results: list[dict[str, Any]]) -> None:
    print(f"640 x 480, caption and H.264 included, {os.cpu_count()} cores")
    print(f"{'backend':<9}{'quality':<9}{'frames/s':>9}{'processor ms/frame':>20}{'first frame s':>15}")
    for r in results:
        if r.get("missing"):
            print(f"{r['backend']:<9}{r['quality']:<9}  its library is not installed")
        else:
            print(
                f"{r['backend']:<9}{r['quality']:<9}{r['fps']:9.1f}{r['processor_ms_per_frame']:20.1f}"
                f"{r['first_frame_s']:15.2f}"
            )


def main() -> None:
    """Run from the command line; `--one` is how it calls itself."""
    if sys.argv[1:2] == ["--one"]:
        quality, frames, repeats = sys.argv[2:]
        print(json.dumps(one(quality, int(frames), int(repeats))))
        return
    sys.exit(run(benchmark))


if __name__ == "__main__":
    main()
