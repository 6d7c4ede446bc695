"""What a model does under the commands of logs, as logs: `python -m sysid.simulate LOGS --model MODEL`."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import tyro

from mecanum_env.cli import run
from mecanum_env.effects.definition import RobotPlant
from mecanum_env.programs import Done


def simulate(
    logs: tyro.conf.Positional[Path],
    /,
    model: Path,
    out: Path = Path("simulated"),
    plant: RobotPlant = "rollers",
) -> Done:
    """Simulate a model under the commands of logs, and write what it would have measured as logs.

    Each simulated run has the commands, stamps, columns and start of the logged one, and its supply voltage,
    which is no result.

    Example: python -m sysid.simulate @examples/logs --model fit/model.json --out simulated

    Args:
        logs: Folder of bench or robot logs, or one file.
        model: Model to simulate.
        out: New folder to write.
        plant: How a robot is simulated; planar does not slip and is much faster.
    """
    # Imported here, so that --help does not wait for the library.
    from tqdm import tqdm

    from mecanum_env.model import read_model
    from mecanum_env.outputs import output_folder, require_empty
    from sysid.compare.predicted import SimulationSettings, predict
    from sysid.logs import read_dataset
    from sysid.logs.writer import write_dataset

    require_empty(out)
    dataset, simulated = read_dataset(logs), read_model(model)
    runs = []
    for one in tqdm(dataset.runs, unit="run", disable=None):
        found = predict(simulated, one, settings=SimulationSettings(plant=plant))
        runs.append(replace(one, channels={**one.channels, **found}))
    with output_folder(out, "sysid.simulate") as staged:
        write_dataset(replace(dataset, name=f"{dataset.name}, simulated", runs=tuple(runs)), staged)
    print(f"wrote {len(runs)} runs to {out}")
    return Done(wrote=[out / one.file for one in runs])


if __name__ == "__main__":
    sys.exit(run(simulate, prog="python -m sysid.simulate"))
