"""LeRobot datasets of version 3: folders of Parquet tables with many episodes in one file.

The layout is that of https://huggingface.co/docs/lerobot/lerobot-dataset-v3: `meta/info.json` says what there
is, `data` holds the frames of all episodes at a fixed rate, `meta/episodes` where each begins,
`meta/tasks.parquet` what it is about, `meta/stats.json` the range of every feature. Videos are not read.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from mecanum_env.errors import InputError, install_command
from mecanum_env.files import atomic_path, write_json
from mecanum_env.units import FloatArray
from sysid.logs.formats.column_map import Numbers
from sysid.logs.formats.foreign import ForeignRun, Part
from sysid.logs.runs import Dataset, Run

INFO: Final = "meta/info.json"
_VERSION: Final = "v3.0"
_DATA: Final = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_VIDEO: Final = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
_FIRST: Final = {"chunk_index": 0, "file_index": 0}
_STAMPS_AGREE_S: Final = 1e-3
"""Stamps are 32-bit floats; those that the frame's number and the rate give, too, are taken from these."""
_ACTION, _STATE = "action", "observation.state"
_INDICES: Final = ("timestamp", "frame_index", "episode_index", "index", "task_index")
_NUMBERS: Final = ("float32", "float64", "int16", "int32", "int64")
_TASK: Final = "drive"


def is_lerobot(path: Path) -> bool:
    """Return whether a folder is a LeRobot dataset."""
    return (path / INFO).is_file()


def read_lerobot(path: Path) -> list[ForeignRun]:
    """Read every episode: columns are ``feature.name``, or ``feature.0`` where the dataset names none.

    Raises:
        InputError: not version 3, files are missing or damaged, or `pyarrow` is not installed.
    """
    info = _info(path)
    pq = _parquet(path)
    features = {
        name: one
        for name, one in info["features"].items()
        if name not in _INDICES and one["dtype"] in _NUMBERS and len(one["shape"]) == 1
    }
    files = sorted(path.glob("data/*/*.parquet"))
    if not files:
        raise InputError(f"{path}: no Parquet files in data/")
    try:
        tables = [pq.read_table(file, columns=[*_INDICES[:3], *features]) for file in files]
        columns: dict[str, Numbers] = {}
        for name in (*_INDICES[:3], *features):
            values = np.concatenate([_values(table[name]) for table in tables])
            columns |= dict(zip(_names(name, features.get(name)), values.T, strict=True))
    except (OSError, KeyError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as a LeRobot dataset ({error})") from error
    episodes = columns.pop("episode_index")
    clock, frame = columns.pop("timestamp").astype(float), columns.pop("frame_index")
    exact = frame / float(info["fps"])
    time = exact if np.max(np.abs(exact - clock), initial=0.0) < _STAMPS_AGREE_S else clock
    stamps = np.asarray(np.rint(time * 1e9), np.int64)
    runs = []
    for number in np.unique(episodes):
        rows = episodes == number
        part = Part({name: values[rows] for name, values in columns.items()}, stamps[rows])
        runs.append(ForeignRun(f"episode_{int(number):06d}", f"{path}, episode {int(number)}", [part]))
    return runs


def write_lerobot(dataset: Dataset, out: Path, fps: int) -> None:
    """Write all runs of a dataset as episodes: commands are the action, what was measured the state.

    A LeRobot dataset has a fixed rate of `fps` frames a second: commands are held, measured channels are
    interpolated between their samples, and held before the first and after the last. Numbers become 32-bit
    floats. The `out` folder must not exist, or be empty.

    Raises:
        InputError: runs of different columns, a folder that cannot be written, or `pyarrow` is not installed.
    """
    pq = _parquet(out)
    import pyarrow as pa

    groups = {_ACTION: tuple(dataset.runs[0].command.columns()), _STATE: _measured(dataset)}
    frames = [_frames(run, groups, fps) for run in dataset.runs]
    lengths = [len(one[_ACTION]) for one in frames]
    data = {name: np.concatenate([one[name] for one in frames]).astype(np.float32) for name in groups}
    indices = _indices(lengths, fps)
    parts: dict[str, Any] = {name: _cells(pa, values) for name, values in data.items()}
    data_file = _DATA.format(**_FIRST)
    tables = {
        data_file: pa.table({**parts, **indices}),
        f"meta/episodes/{data_file.removeprefix('data/')}": pa.table(_episodes(lengths)),
        "meta/tasks.parquet": _tasks(pa),
    }
    for name, table in tables.items():
        with atomic_path(out / name) as temporary:
            pq.write_table(table, temporary)
    stats = {name: _stats(values) for name, values in {**data, **indices}.items()}
    write_json(out / "meta" / "stats.json", stats)
    # Last, because it makes the folder a dataset.
    write_json(out / INFO, _described(groups, indices, lengths, fps))


def _indices(lengths: Sequence[int], fps: int) -> dict[str, Numbers]:
    """Return the columns that say where each frame belongs, for episodes of so many frames."""
    total = sum(lengths)
    return {
        "timestamp": np.concatenate([np.arange(n) / fps for n in lengths]).astype(np.float32),
        "frame_index": np.concatenate([np.arange(n) for n in lengths]),
        "episode_index": np.repeat(np.arange(len(lengths)), lengths),
        "index": np.arange(total),
        "task_index": np.zeros(total, np.int64),
    }


def _episodes(lengths: Sequence[int]) -> dict[str, Any]:
    """Return the columns of the table of episodes: what each is about, and where it is."""
    ends, first = np.cumsum(lengths), np.zeros(len(lengths), np.int64)
    return {
        "episode_index": np.arange(len(lengths)),
        "tasks": [[_TASK]] * len(lengths),
        "length": lengths,
        **{f"data/{name}": first for name in _FIRST},
        "dataset_from_index": ends - lengths,
        "dataset_to_index": ends,
        **{f"meta/episodes/{name}": first for name in _FIRST},
    }


def _described(
    groups: Mapping[str, Sequence[str]], indices: Mapping[str, Numbers], lengths: Sequence[int], fps: int
) -> dict[str, Any]:
    """Return what `meta/info.json` says of a dataset: its features, its size and where its files are."""
    features: dict[str, dict[str, Any]] = {
        name: {"dtype": "float32", "shape": [len(names)], "names": list(names)}
        for name, names in groups.items()
    }
    features |= {
        name: {"dtype": str(values.dtype), "shape": [1], "names": None} for name, values in indices.items()
    }
    return {
        "codebase_version": _VERSION,
        "robot_type": "mecanum",
        "fps": fps,
        "features": features,
        "total_episodes": len(lengths),
        "total_frames": sum(lengths),
        "total_tasks": 1,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "splits": {"train": f"0:{len(lengths)}"},
        "data_path": _DATA,
        "video_path": _VIDEO,
    }


def _info(path: Path) -> dict[str, Any]:
    try:
        info: dict[str, Any] = json.loads((path / INFO).read_text(encoding="utf-8"))
        version, _, _ = str(info["codebase_version"]), float(info["fps"]), info["features"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path / INFO}: cannot be read ({error})") from error
    if not version.startswith("v3."):
        raise InputError(
            f"{path / INFO}: codebase_version = {version}, must be v3; LeRobot converts older ones: "
            "python -m lerobot.datasets.v30.convert_dataset_v21_to_v30"
        )
    return info


def _parquet(path: Path) -> Any:
    try:
        import pyarrow.parquet as pq
    except ImportError as error:
        raise InputError(f"{path}: LeRobot datasets need pyarrow: {install_command('parquet')}") from error
    return pq


def _values(column: Any) -> Numbers:
    """Return a column of numbers, or of lists of equal length, as an array of shape (n, width)."""
    chunks = [np.asarray(chunk.flatten() if hasattr(chunk, "flatten") else chunk) for chunk in column.chunks]
    flat = np.concatenate(chunks) if chunks else np.zeros(0)
    return flat.reshape(len(column), -1)


def _names(feature: str, described: Mapping[str, Any] | None) -> list[str]:
    if described is None:
        return [feature]
    names: Any = described.get("names")
    if isinstance(names, Mapping):  # {"motors": [...]}
        names = next(iter(names.values()), None)
    width = int(described["shape"][0])
    if not isinstance(names, list) or len(names) != width:
        names = list(range(width))
    return (
        [feature]
        if width == 1 and described.get("names") is None
        else [f"{feature}.{name}" for name in names]
    )


def _measured(dataset: Dataset) -> tuple[str, ...]:
    names = tuple(dataset.runs[0].channels)
    for run in dataset.runs:
        if set(run.channels) != set(names):
            first, names_text = dataset.runs[0].file, ", ".join(names)
            raise InputError(
                f"{run.file}: measures {', '.join(run.channels)}, but {first} {names_text}; a LeRobot "
                "dataset has one set of columns: export the runs apart"
            )
    return names


def _frames(run: Run, groups: Mapping[str, Sequence[str]], fps: int) -> dict[str, FloatArray]:
    time = np.arange(int(run.duration_s * fps + 1e-6) + 1) / fps
    rows = np.searchsorted(run.time_s, time + 1e-9, side="right") - 1
    held = [run.command.columns()[name][rows] for name in groups[_ACTION]]
    measured = []
    for name in groups[_STATE]:
        there = run.finite(name)
        if not there.any():
            raise InputError(f"{run.file}: {name} has no sample; a LeRobot dataset has no empty cells")
        measured.append(np.interp(time, run.time_s[there], run.channels[name][there]))
    return {_ACTION: np.column_stack(held), _STATE: np.column_stack(measured)}


def _cells(pa: Any, values: Numbers) -> Any:
    """Return rows as lists of fixed length; as plain numbers where a row has one, as LeRobot wants it."""
    flat = pa.array(values.reshape(-1))
    return flat if values.shape[1] == 1 else pa.FixedSizeListArray.from_arrays(flat, values.shape[1])


def _tasks(pa: Any) -> Any:
    """Return the table of tasks, whose names are the index of the data frame that LeRobot reads it into."""
    index = "__index_level_0__"
    table = pa.table({"task_index": np.zeros(1, np.int64), index: [_TASK]})
    kinds = (("task_index", "int64", "int64"), (index, "unicode", "object"))
    described = {
        "index_columns": [index],
        "column_indexes": [],
        "columns": [
            {
                **{"name": None if name == index else name, "field_name": name},
                **{"pandas_type": kind, "numpy_type": numpy, "metadata": None},
            }
            for name, kind, numpy in kinds
        ],
        "pandas_version": "2.0.0",
    }
    return table.replace_schema_metadata({"pandas": json.dumps(described)})


def _stats(values: Numbers) -> dict[str, Any]:
    rows = values.reshape(len(values), -1).astype(float)
    found = {name: getattr(np, name)(rows, axis=0).tolist() for name in ("min", "max", "mean", "std")}
    return {**found, "count": [len(rows)]}
