import gzip
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.units import FloatArray
from sysid.logs import BenchCommand, BodyCommand, Dataset, Run, WheelCommand, read_dataset
from sysid.logs.writer import write_dataset

Folder = Callable[[dict[str, str | bytes]], Path]


def test_a_bench_run_is_read(folder: Folder, step: str) -> None:
    data = read_dataset(folder({"run.csv": step}))
    (run,) = data.runs
    assert (data.name, data.level, run.file, run.group, run.split) == (
        "logs",
        "bench",
        "run.csv",
        "run",
        "fit",
    )
    assert isinstance(run.command, BenchCommand)
    np.testing.assert_array_equal(run.time_s, [0.0, 0.1, 0.2, 0.3])
    np.testing.assert_array_equal(run.command.command_rpm, [0, 40, 40, 40])
    np.testing.assert_array_equal(run.channel("speed_rpm"), [0, 0, 30, 39])
    assert run.duration_s == 0.3


def test_arrays_are_read_only(folder: Folder, step: str) -> None:
    run = read_dataset(folder({"run.csv": step})).runs[0]
    with pytest.raises(ValueError, match="read-only"):
        run.time_s[0] = 1.0


def test_time_starts_at_the_first_stamp(folder: Folder) -> None:
    text = "time_s,command_rpm,speed_rpm\n1000.5,1,0\n1000.75,1,0\n"
    run = read_dataset(folder({"run.csv": text})).runs[0]
    np.testing.assert_array_equal(run.time_s, [0.0, 0.25])
    assert run.start_s == 1000.5


def test_empty_and_nan_cells_are_missing_samples(folder: Folder) -> None:
    text = "time_s,speed_rpm,command_rpm\n0,,1\n1,nan,1\n2,NaN,1\n3, ,1\n4,5,\n"
    run = read_dataset(folder({"run.csv": text})).runs[0]
    np.testing.assert_array_equal(run.channel("speed_rpm"), [np.nan] * 4 + [5.0])
    np.testing.assert_array_equal(run.finite("speed_rpm"), [False] * 4 + [True])


@pytest.mark.parametrize("cells", [(",,1", ",,"), ("1,,", ",,1")])
def test_missing_cells_may_be_anywhere(folder: Folder, cells: tuple[str, str]) -> None:
    header = (
        "vx_m_s,vy_m_s,yaw_rate_rad_s,time_s,command_fl_rpm,command_fr_rpm,command_rl_rpm,command_rr_rpm,x_m"
    )
    rows = [f"{cells[0]},0,1,2,3,4,", f"{cells[1]},1,,,,,9"]
    run = read_dataset(folder({"run.csv": "\n".join([header, *rows])})).runs[0]
    assert sum(run.finite(name).sum() for name in ("vx_m_s", "vy_m_s", "yaw_rate_rad_s")) in (1, 2)
    np.testing.assert_array_equal(run.channel("x_m"), [np.nan, 9.0])
    np.testing.assert_array_equal(run.command.wheels_rpm, [[1, 2, 3, 4]] * 2)


def test_a_missing_command_is_still_held(folder: Folder) -> None:
    text = "time_s,command_rpm,speed_rpm\n0,,0\n1,,0\n2,40,0\n3,,0\n4,0,0\n5,,0\n"
    data = read_dataset(folder({"run.csv": text}))
    np.testing.assert_array_equal(data.runs[0].command.wheels_rpm[:, 0], [0, 0, 40, 40, 0, 0])
    (late,) = [f for f in data.findings if f.kind == "late_command"]
    assert late.value == 2.0


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.replace("\n", "\r"),
        lambda text: "\ufeff" + text,
        lambda text: text.rstrip("\n"),
        lambda text: text + "\n\n",
        lambda text: text.replace(",", " , "),
        lambda text: text.replace("40,30", '"40","30"'),
    ],
    ids=["crlf", "cr", "bom", "no last newline", "blank end", "spaces", "quotes"],
)
def test_text_of_other_programs_is_read(folder: Folder, step: str, change: Callable[[str], str]) -> None:
    run = read_dataset(folder({"run.csv": change(step)})).runs[0]
    np.testing.assert_array_equal(run.channel("speed_rpm"), [0, 0, 30, 39])


def test_all_three_formats_give_the_same(tmp_path: Path, step: str, folder: Folder) -> None:
    pytest.importorskip("pyarrow")
    data = read_dataset(folder({"run.csv": step}))
    for suffix in ("csv", "csv.gz", "parquet"):
        run = data.runs[0]
        renamed = Run(f"run.{suffix}", "g", "fit", run.time_s, run.command, run.channels)
        write_dataset(Dataset("same", (renamed,), ()), tmp_path / suffix)
        other = read_dataset(tmp_path / suffix).runs[0]
        np.testing.assert_array_equal(other.time_s, run.time_s)
        np.testing.assert_array_equal(other.channel("speed_rpm"), run.channel("speed_rpm"))


def test_columns_are_renamed_and_scaled(folder: Folder) -> None:
    toml = (
        "[dataset]\nname = 'mine'\nignore_columns = ['current_a']\n[columns]\n"
        "time_s = {from = 'ms', scale = 0.001}\nspeed_rpm = {from = 'omega', scale = 2.0, offset = -1}\n"
    )
    text = "ms,command_rpm,omega,current_a\n0,5,1,0.2\n500,5,2,0.3\n"
    data = read_dataset(folder({"run.csv": text, "dataset.toml": toml}))
    assert data.name == "mine"
    np.testing.assert_array_equal(data.runs[0].time_s, [0.0, 0.5])
    np.testing.assert_array_equal(data.runs[0].channel("speed_rpm"), [1.0, 3.0])


def test_a_column_of_text_may_be_ignored(folder: Folder) -> None:
    toml = "[dataset]\nignore_columns = ['comment', 'mode']\n"
    text = 'time_s,command_rpm,comment,speed_rpm,mode\n0,5,"hi, there",1,\n0.5,5,,2,inf\n'
    run = read_dataset(folder({"run.csv": text, "dataset.toml": toml})).runs[0]
    np.testing.assert_array_equal(run.channel("speed_rpm"), [1.0, 2.0])
    assert list(run.channels) == ["speed_rpm"]


def test_a_column_of_text_of_a_parquet_file_may_be_ignored(tmp_path: Path) -> None:
    pa = pytest.importorskip("pyarrow")
    columns = {"time_s": [0.0, 0.5], "comment": ["hi", "ho"], "command_rpm": [5, 5], "speed_rpm": [1.0, 2.0]}
    pytest.importorskip("pyarrow.parquet").write_table(pa.table(columns), tmp_path / "run.parquet")
    (tmp_path / "dataset.toml").write_text("[dataset]\nignore_columns = ['comment']\n")
    np.testing.assert_array_equal(read_dataset(tmp_path).runs[0].channel("speed_rpm"), [1.0, 2.0])


def test_a_column_may_be_scaled_under_its_own_name(folder: Folder, step: str) -> None:
    toml = "[columns]\nspeed_rpm = {from = 'speed_rpm', scale = 10}\n"
    run = read_dataset(folder({"run.csv": step, "dataset.toml": toml})).runs[0]
    np.testing.assert_array_equal(run.channel("speed_rpm"), [0, 0, 300, 390])


def test_one_file_is_read_with_the_settings_beside_it(folder: Folder, step: str) -> None:
    toml = "[dataset]\nname='two'\n[[runs]]\nfile='b.csv'\ngroup='g'\nsplit='test'\n[[runs]]\nfile='a.csv'\n"
    path = folder({"a.csv": step, "b.csv": step, "dataset.toml": toml})
    (run,) = read_dataset(path / "b.csv").runs
    assert (run.group, run.split) == ("g", "test")
    assert len(read_dataset(path / "dataset.toml").runs) == 2


def test_other_files_and_hidden_ones_are_ignored(folder: Folder, step: str) -> None:
    path = folder({"a.csv": step, "._a.csv": b"\x00\x01", "robot.json": "{}", "LICENSE": "free"})
    assert [run.file for run in read_dataset(path).runs] == ["a.csv"]


def test_files_not_listed_are_read_and_reported(folder: Folder, step: str) -> None:
    data = read_dataset(folder({"a.csv": step, "b.csv": step, "dataset.toml": "[[runs]]\nfile='a.csv'\n"}))
    assert [run.file for run in data.runs] == ["a.csv", "b.csv"]
    assert [f.file for f in data.findings if f.kind == "unlisted"] == ["b.csv"]


def test_the_digest_follows_the_data(folder: Folder, step: str) -> None:
    first = read_dataset(folder({"a.csv": step})).sha256
    assert first == read_dataset(folder({"a.csv": step})).sha256
    assert first != read_dataset(folder({"a.csv": step.replace("39", "38")})).sha256
    assert first != read_dataset(folder({"a.csv": step, "dataset.toml": "[dataset]\nname='x'\n"})).sha256


def test_gzip_text_with_missing_cells_far_down_is_found_by_line(folder: Folder) -> None:
    rows = [f"{i},1,{i % 7}" for i in range(20_000)]
    rows[17_000] = "17000,1,oops"
    text = "time_s,command_rpm,speed_rpm\n" + "\n".join(rows)
    with pytest.raises(ValueError, match=r"line 17002: speed_rpm = 'oops'"):
        read_dataset(folder({"run.csv.gz": gzip.compress(text.encode())}))


numbers = st.floats(allow_nan=True, allow_infinity=False)


@st.composite
def runs(draw: st.DrawFn) -> Run:
    n = draw(st.integers(2, 8))

    def column(cells: st.SearchStrategy[float] = numbers) -> FloatArray:
        return np.array(draw(st.lists(cells, min_size=n, max_size=n)))

    small = st.floats(-1e6, 1e6, allow_subnormal=False)
    command = draw(st.sampled_from(["bench", "body", "wheels"]))
    time = np.concatenate(
        [[0.0], np.cumsum(draw(st.lists(st.floats(1e-6, 1e3), min_size=n - 1, max_size=n - 1)))]
    )
    names = ["speed_rpm"] if command == "bench" else ["speed_fl_rpm", "vx_m_s", "yaw_rad"]
    channels = {name: column() for name in [*names, "battery_v"]}
    channels[names[0]][0] = 1.0
    made = {
        "bench": lambda: BenchCommand(column(small)),
        "body": lambda: BodyCommand(column(small), column(small), column(small)),
        "wheels": lambda: WheelCommand(np.column_stack([column(small) for _ in range(4)])),
    }[command]()
    return Run("run.csv", "a group", "test", time, made, channels)


@given(
    run=runs(),
    suffix=st.sampled_from(["csv", "csv.gz", "parquet"]),
    name=st.text(min_size=1).filter(str.strip),
)
def test_a_written_dataset_reads_back_equal(
    run: Run, suffix: str, name: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    if suffix == "parquet":
        pytest.importorskip("pyarrow")
    path = tmp_path_factory.mktemp("round")
    run = Run(f"run.{suffix}", run.group, run.split, run.time_s, run.command, run.channels)
    write_dataset(Dataset(name, (run,), ()), path)
    data = read_dataset(path)
    (back,) = data.runs
    assert (data.name, back.file, back.group, back.split) == (name, run.file, run.group, run.split)
    np.testing.assert_array_equal(back.time_s, run.time_s)
    assert set(back.channels) == set(run.channels)
    for key, values in run.channels.items():
        np.testing.assert_array_equal(back.channel(key), values)
    for key, values in run.command.columns().items():
        np.testing.assert_array_equal(back.command.columns()[key], values)
