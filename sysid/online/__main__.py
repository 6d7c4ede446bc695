"""Command line: `python -m sysid.online LOG`."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import tyro
from tqdm import tqdm

from mecanum_env.cli import run
from mecanum_env.files import require_writable, write_json
from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.model import read_model
from sysid.fit.command_path import CommandPath
from sysid.logs import read_dataset
from sysid.online.history import LawMetrics, law_metrics
from sysid.online.plot import save_plot
from sysid.online.projection import OnlineOptions
from sysid.online.replay import WheelHistory, replay, replay_path

FORMAT: Final = "mecanum-online-history/1"
_TABLE_ROWS: Final = 10
_FIGURES: Final = 400
_MISFIT: Final = 5.0


def main(
    log: Annotated[Path, tyro.conf.Positional],
    out: Path = Path("online"),
    model: Path | None = None,
    sample_period_s: float | None = None,
    memory_samples: float = OnlineOptions.memory_samples,
    noise_rpm: float = OnlineOptions.noise_rpm,
    quantum_rpm: float = OnlineOptions.quantum_rpm,
) -> None:
    """Replay a log through the online estimator and plot what it knew over time.

    Writes OUT/online.json and one OUT/online_WHEEL.png a wheel, and prints a short table.

    Example: python -m sysid.online logs/bench --out online

    Args:
        log: a folder of runs, or one run.
        out: folder for the results.
        model: a model.json to start from, with its period and ceiling; default: a plain first-order lag.
        sample_period_s: period of the law [s]; default: the model's, else 1/120 s or the log's own if longer.
        memory_samples: how many samples the estimator remembers while the law is steady.
        noise_rpm: rough standard deviation of the measured speed [rpm].
        quantum_rpm: resolution of the measured speed [rpm].
    """
    options = OnlineOptions(memory_samples=memory_samples, noise_rpm=noise_rpm, quantum_rpm=quantum_rpm)
    dataset = read_dataset(log)
    require_writable(out / "online.json")
    wheel = None if model is None else read_model(model).wheel
    period = sample_period_s if sample_period_s or wheel is None else wheel.law.sample_period_s
    path = replay_path(dataset, period, None if wheel is None else wheel.saturation_rpm)
    law = None if wheel is None else wheel.law
    with tqdm(unit=" samples", desc="replay", leave=False, disable=None) as bar:

        def counted(ticks: Iterable[int]) -> Iterable[int]:
            for tick in ticks:
                yield tick
                bar.update()

        wheels = replay(dataset, options, law, path, counted)
    figures = [law_metrics(w.history, max(1, len(w.history.speed_rpm) // _FIGURES)) for w in wheels]
    for note in path.notes:
        print(f"note: {note}")
    for item, values in zip(wheels, figures, strict=True):
        print(_table(item, values))
        if (times := item.history.noise_rpm[-1] / options.noise_rpm) > _MISFIT:
            print(
                f"note: {item.wheel}: the innovations are still {times:.0f} times the noise expected "
                f"({options.noise_rpm:g} rpm): the wheel is more than a law, or --noise-rpm is too small"
            )
        save_plot(out / f"online_{item.wheel}.png", f"{dataset.name}: {item.wheel}", item, values)
    write_json(out / "online.json", _json(dataset.name, dataset.sha256, path, options, wheels, figures))
    print(f"wrote {out / 'online.json'} and {len(wheels)} plot(s) online_*.png beside it")


def _table(wheel: WheelHistory, figures: LawMetrics) -> str:
    history = wheel.history
    rows = np.unique(np.linspace(0, len(figures.tick) - 1, _TABLE_ROWS + 1).astype(int))[1:]
    head = f"{wheel.wheel}: {len(wheel.files)} run(s), {len(history.speed_rpm)} ticks of "
    lines = [
        head + f"{history.sample_period_s * 1e3:.4g} ms",
        f"{'time s':>8} "
        + " ".join(f"{name:>7}" for name in COEFFICIENTS)
        + f" {'rise ms':>8} {'lag ms':>14} {'pole':>6} {'error rpm':>9}",
    ]
    before = 0
    for row in rows:
        tick = int(figures.tick[row])
        error = _rms(history.innovation_rpm[before : tick + 1])
        lag = f"{1e3 * figures.mean_lag_s[row]:.1f} +- {1e3 * figures.mean_lag_error_s[row]:.1f}"
        lines.append(
            f"{history.time_s[tick]:8.2f} "
            + " ".join(f"{value:7.3f}" for value in history.coefficients[tick])
            + f" {1e3 * figures.rise_time_s[row]:8.1f} {lag:>14}"
            + f" {figures.dominant_pole[row]:6.3f} {error:9.2f}"
        )
        before = tick + 1
    return "\n".join(lines)


def _rms(values: Any) -> float:
    finite = np.asarray(values)[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if finite.size else math.nan


def _json(
    name: str,
    sha256: str,
    path: CommandPath,
    options: OnlineOptions,
    wheels: tuple[WheelHistory, ...],
    figures: list[LawMetrics],
) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "dataset": name,
        "data_sha256": sha256,
        "notes": list(path.notes),
        "options": {k: _plain(v) for k, v in vars(options).items()},
        "wheels": {w.wheel: _wheel_json(w, f) for w, f in zip(wheels, figures, strict=True)},
    }


def _wheel_json(wheel: WheelHistory, figures: LawMetrics) -> dict[str, Any]:
    history = wheel.history
    final = history.law(-1)
    errors = history.standard_errors[figures.tick]
    return {
        "files": list(wheel.files),
        "run_start_s": [_plain(history.time_s[tick]) for tick in wheel.run_start],
        "law": {**{n: getattr(final, n) for n in COEFFICIENTS}, "sample_period_s": final.sample_period_s},
        "standard_errors": dict(zip(COEFFICIENTS, errors[-1].tolist(), strict=True)),
        "innovation_rms_rpm": _plain(_rms(history.innovation_rpm)),
        "history": {
            "time_s": history.time_s[figures.tick].tolist(),
            "noise_rpm": history.noise_rpm[figures.tick].tolist(),
            "coefficients": history.coefficients[figures.tick].tolist(),
            "standard_errors": errors.tolist(),
            "rise_time_s": [_plain(v) for v in figures.rise_time_s],
            "mean_lag_s": figures.mean_lag_s.tolist(),
            "mean_lag_error_s": figures.mean_lag_error_s.tolist(),
            "dominant_pole": figures.dominant_pole.tolist(),
            "dc_gain": figures.dc_gain.tolist(),
        },
    }


def _plain(value: float) -> float | None:
    """JSON has no infinity and no nan."""
    return float(value) if math.isfinite(value) else None


if __name__ == "__main__":
    sys.exit(run(main, prog="python -m sysid.online"))
