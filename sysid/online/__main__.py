"""Command line: `python -m sysid.online LOG`."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import tyro

from mecanum_env.cli import run
from mecanum_env.programs import Done
from sysid.online.options import OnlineOptions


def main(
    log: Annotated[Path, tyro.conf.Positional],
    out: Path = Path("online"),
    model: Path | None = None,
    sample_period: float | None = None,
    memory: float = OnlineOptions.memory_samples,
    noise: float = OnlineOptions.noise_rpm,
    quantum: float = OnlineOptions.quantum_rpm,
) -> Done:
    """Replay a log through the online estimator and plot what it knew over time.

    Writes OUT/online.json and an OUT/online_WHEEL.png for each wheel, and prints a short table.

    Example: python -m sysid.online logs/bench --out online

    Args:
        log: a folder of runs, or one run.
        out: folder for the results.
        model: a model.json to start from, with its period and ceiling; default: a plain first-order lag.
        sample_period: period of the law [s]; default: the model's, else 1/120 s or the log's own if longer.
        memory: how many samples the estimator remembers while the law is steady.
        noise: rough standard deviation of the measured speed [rpm].
        quantum: resolution of the measured speed [rpm].
    """
    # Imported here, so that --help does not wait for the library.
    from tqdm import tqdm

    from mecanum_env.files import write_json
    from mecanum_env.model import read_model
    from mecanum_env.outputs import output_folder
    from sysid.logs import read_dataset
    from sysid.online.replay import replay, replay_path
    from sysid.online.report import misfit_note, online_json, report_metrics, save_plot, table

    options = OnlineOptions(memory_samples=memory, noise_rpm=noise, quantum_rpm=quantum)
    dataset = read_dataset(log)
    law = ceiling_rpm = None
    if model is not None:
        wheel = read_model(model).wheel
        law, ceiling_rpm = wheel.law, wheel.saturation_rpm
        sample_period = sample_period or law.sample_period_s
    path = replay_path(dataset, sample_period, ceiling_rpm)
    bar = tqdm(unit=" samples", desc="replay", leave=False, disable=None)
    with output_folder(out, "sysid.online", ("online.json", "online_*.png")) as staged, bar:

        def counted(ticks: Iterable[int]) -> Iterable[int]:
            for tick in ticks:
                yield tick
                bar.update()

        wheels = replay(dataset, options, law, path, counted)
        metrics = [report_metrics(wheel) for wheel in wheels]
        for history, values in zip(wheels, metrics, strict=True):
            name = f"online_{history.wheel}.png"
            save_plot(staged / name, f"{dataset.name}: {history.wheel}", history, values)
        write_json(staged / "online.json", online_json(dataset, path, options, wheels, metrics))
    for note in path.notes:
        print(f"note: {note}")
    for history, values in zip(wheels, metrics, strict=True):
        print(table(history, values))
        if misfit := misfit_note(history, options):
            print(f"note: {misfit}")
    print(f"wrote {out / 'online.json'} and {len(wheels)} plot(s) online_*.png beside it")
    return Done(wrote=[out / "online.json"])


if __name__ == "__main__":
    sys.exit(run(main, prog="python -m sysid.online"))
