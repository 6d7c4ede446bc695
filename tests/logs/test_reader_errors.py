"""Every error of the reader names the file, the line, the value and what would be right."""

import gzip
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mecanum_env.errors import InputError
from sysid.logs import read_dataset
from sysid.logs.writer import write_columns

Folder = Callable[[dict[str, str | bytes]], Path]
HEADER = "time_s,command_rpm,speed_rpm\n"
ROBOT = "time_s,command_v_rpm,command_theta_deg,command_vc_rpm,vx_m_s\n0,1,0,0,0\n1,1,0,0,0\n"

BAD_RUNS = {
    "empty": ("", "run.csv: is empty; a log has a header row"),
    "blank": ("\n \n", "run.csv: is empty"),
    "no rows": (HEADER, "run.csv: has a header but no rows; a run needs at least 2"),
    "one row": (HEADER + "0,1,2\n", "run.csv, line 2: the only row; a run needs at least 2"),
    "no header": (
        "0,1,2\n1,1,2\n",
        "line 1: '0,1,2' is a row of numbers; the first line must name the columns",
    ),
    "unnamed column": ("time_s,,speed_rpm\n0,1,2\n", "line 1: column 2 has no name"),
    "column twice": ("time_s,speed_rpm,speed_rpm\n0,1,2\n", "line 1: column 'speed_rpm' appears twice"),
    "text": (
        HEADER + "0,0,0\n1,0,fast\n2,0,0\n",
        "run.csv, line 3: speed_rpm = 'fast', must be a number; leave",
    ),
    "NA": (HEADER + "0,0,0\n1,0,NA\n", "line 3: speed_rpm = 'NA', must be a number"),
    "underscore": (HEADER + "0,0,0\n1,0,1_000\n", "line 3: speed_rpm = '1_000', must be a number"),
    "text after blank lines": (HEADER + "\n0,0,0\n\n1,x,0\n", "line 5: command_rpm = 'x', must be a number"),
    "short row": (
        HEADER + "0,0,0\n1,0\n2,0,0\n",
        "line 3: 2 cells, must be 3 as in the header (time_s, command_rpm",
    ),
    "long row": (HEADER + "0,0,0\n1,0,0,7\n", "line 3: 4 cells, must be 3"),
    "all rows short": (HEADER + "0,0\n1,0\n", "line 2: 2 cells, must be 3"),
    "infinite": (HEADER + "0,0,0\n1,0,inf\n", "line 3: speed_rpm = inf, must be a finite number"),
    "overflow": (HEADER + "0,0,0\n1,0,-1e999\n", "line 3: speed_rpm = -inf, must be a finite number"),
    "stamp back": (HEADER + "0,0,0\n0.2,0,0\n0.1,0,0\n", "line 4: time_s = 0.1 after 0.2, must be larger"),
    "stamp twice": (HEADER + "0,0,0\n\n0.5,0,0\n0.5,0,0\n", "line 5: time_s = 0.5 after 0.5, must be larger"),
    "stamp far away": (
        HEADER + "0,0,0\n4.99,0,0\n1e9,40,40\n",
        "line 4: time_s jumps from 4.99 to 1000000000.0 s, by more than 3600 s; split the run there",
    ),
    "stamps of days": (
        HEADER + "".join(f"{max(i / 10, 3000 * (i - 50))},0,0\n" for i in range(90)),
        "line 81: time_s = 87000.0 is 87000 s after the first stamp, must be at most 86400 s; split",
    ),
    "stamp missing": (HEADER + "0,0,0\n,0,0\n1,0,0\n", "line 3: time_s is missing; every row needs a stamp"),
    "points and commas": (
        "time_s;command_rpm;speed_rpm\n0;1;2\n0,5;1;2\n1.5;1;2\n",
        "line 4 has a number with a decimal point and line 3 one with a comma; write all of them alike",
    ),
    "unknown column": (
        "time_s,command_rpm,sped_rpm\n0,1,2\n1,1,2\n",
        "line 1: unknown column 'sped_rpm' (did you mean \"speed_rpm\"?); known: time_s, command_rpm",
    ),
    "no time": (
        "command_rpm,speed_rpm\n1,2\n1,2\n",
        "line 1: column time_s is missing; the file has command_rpm",
    ),
    "no speed": (
        "time_s,command_rpm\n0,1\n1,1\n",
        "line 1: column speed_rpm is missing; the file has time_s",
    ),
    "no command": (
        "time_s,speed_rpm\n0,1\n1,1\n",
        "line 1: no command column; a bench log needs command_rpm",
    ),
    "no robot command": (
        "time_s,vx_m_s\n0,1\n1,1\n",
        "no command column; a robot log needs command_v_rpm, command_",
    ),
    "part of a command": (
        "time_s,command_v_rpm,vx_m_s\n0,1,2\n1,1,2\n",
        "line 1: column command_theta_deg, command_vc_rpm is missing",
    ),
    "both command sets": (
        ROBOT.replace("\n", ",command_fl_rpm\n", 1).replace(",0\n", ",0,0\n"),
        "line 1: both command sets (command_v_rpm, command_theta_deg, command_vc_rpm, command_fl_rpm); keep",
    ),
    "bench and robot": (
        "time_s,command_rpm,speed_rpm,vx_m_s\n0,1,2,3\n1,1,2,3\n",
        "line 1: command_rpm belongs to a bench log and vx_m_s to a robot log; keep the columns of one",
    ),
    "no channel": (
        "time_s,command_v_rpm,command_theta_deg,command_vc_rpm,battery_v\n0,1,2,3,4\n1,1,2,3,4\n",
        "line 1: no measured column; a robot log needs one of speed_fl_rpm",
    ),
    "no sample": (HEADER + "0,1,\n1,1,\n", "run.csv: no measured sample in any of speed_rpm"),
    "no command value": (HEADER + "0,,1\n1,nan,1\n", "run.csv: command_rpm has no value in any row"),
    "quote never closed": (HEADER + '0,0,0\n1,"0,0\n', "run.csv, line 3:"),
}


@pytest.mark.parametrize("case", BAD_RUNS)
def test_a_bad_run_is_refused_with_its_place(folder: Folder, case: str) -> None:
    text, message = BAD_RUNS[case]
    with pytest.raises(InputError) as refusal:
        read_dataset(folder({"run.csv": text}))
    assert message in str(refusal.value)
    assert str(refusal.value).count("\n") == 0


BAD_SETTINGS = {
    "not toml": ("[dataset\n", "dataset.toml: not valid TOML:"),
    "top key": (
        "[datasets]\nname='x'\n",
        'line 1: unknown key "datasets" (did you mean "dataset"?); known: dataset',
    ),
    "dataset key": ("[dataset]\nnames='x'\n", 'line 2: [dataset] unknown key "names" (did you mean "name"?)'),
    "empty name": ("[dataset]\nname = ''\n", "line 2: name = '', must be a non-empty string"),
    "ignore": (
        "[dataset]\nignore_columns = 'x'\n",
        "line 2: ignore_columns = 'x', must be a list of column names",
    ),
    "our column": ("[columns]\nspeed = {from='w'}\n", 'line 2: [columns] unknown key "speed"'),
    "plain column": ("[columns]\nspeed_rpm = 'w'\n", "line 2: speed_rpm = 'w', must be a table such as"),
    "no from": ("[columns]\nspeed_rpm = {scale=2}\n", 'line 2: speed_rpm lacks "from"'),
    "column key": (
        "[columns]\nspeed_rpm = {from='w', scales=2}\n",
        'unknown key "scales" (did you mean "scale"?)',
    ),
    "text scale": ("[columns]\nspeed_rpm = {from='w', scale='2'}\n", "scale = '2', must be a finite number"),
    "true scale": (
        "[columns]\nspeed_rpm = {from='w', scale=true}\n",
        "scale = True, must be a finite number",
    ),
    "infinite scale": (
        "[columns]\nspeed_rpm = {from='w', scale=inf}\n",
        "scale = inf, must be a finite number",
    ),
    "zero scale": ("[columns]\nspeed_rpm = {from='w', scale=0}\n", "scale = 0, must not be 0"),
    "source nowhere": (
        "[columns]\nspeed_rpm = {from='sped_rpm'}\n",
        "no file has a column 'sped_rpm', though speed_rpm is to come from it (did you mean \"speed_rpm\"?)",
    ),
    "ignored nowhere": (
        "[dataset]\nignore_columns = ['x']\n",
        "no file has a column 'x', though it is to be ignored",
    ),
    "made twice": (
        "[columns]\nspeed_rpm = {from='command_rpm'}\n",
        "speed_rpm is a column of the file, and dataset.toml also makes it from 'command_rpm'; keep one",
    ),
    "runs table": ("[runs]\nfile='run.csv'\n", "runs must be an array of tables: [[runs]]"),
    "run key": ("[[runs]]\nfile='run.csv'\nsplits='fit'\n", 'line 3: [[runs]] unknown key "splits"'),
    "no file": ("[[runs]]\nsplit='fit'\n", 'a [[runs]] entry lacks "file"'),
    "path": (
        "[[runs]]\nfile='a/run.csv'\n",
        'line 2: file = "a/run.csv", must be a file name in the same folder',
    ),
    "twice": (
        "[[runs]]\nfile='run.csv'\n[[runs]]\nfile='run.csv'\n",
        'line 4: run "run.csv" is listed twice',
    ),
    "absent": ("[[runs]]\nfile='rin.csv'\n", "run 'rin.csv' is listed, but"),
    "split": (
        "[[runs]]\nfile='run.csv'\nsplit='tests'\n",
        'line 3: split = "tests" (did you mean "test"?), must be one of fit, validation, test',
    ),
    "number group": ("[[runs]]\nfile='run.csv'\ngroup=3\n", "line 3: group = 3, must be a non-empty string"),
}


@pytest.mark.parametrize("case", BAD_SETTINGS)
def test_a_bad_dataset_toml_is_refused_with_its_place(folder: Folder, step: str, case: str) -> None:
    text, message = BAD_SETTINGS[case]
    with pytest.raises(InputError) as refusal:
        read_dataset(folder({"run.csv": step, "dataset.toml": text}))
    assert message in str(refusal.value)


def test_a_file_that_is_not_text_is_refused(folder: Folder) -> None:
    with pytest.raises(InputError, match=r"run.csv, line 2: not UTF-8 text"):
        read_dataset(folder({"run.csv": HEADER.encode() + b"\xff\xfe,1,2\n"}))


def test_a_broken_gzip_file_is_refused(folder: Folder, step: str) -> None:
    whole = gzip.compress(step.encode())
    for broken in (whole[:-9], b"time_s,speed_rpm\n"):
        with pytest.raises(InputError, match=r"run.csv.gz: not a whole gzip file"):
            read_dataset(folder({"run.csv.gz": broken}))


def test_a_broken_parquet_file_is_refused(folder: Folder) -> None:
    pytest.importorskip("pyarrow")
    with pytest.raises(InputError, match=r"run.parquet: not a Parquet file"):
        read_dataset(folder({"run.parquet": b"PAR1 not really"}))


def test_parquet_is_not_written_without_pyarrow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(
        InputError, match=r"a\.parquet: writing Parquet needs pyarrow: `pip install .*parquet"
    ):
        write_columns({"time_s": np.arange(2.0)}, tmp_path / "a.parquet")


def test_parquet_without_pyarrow_names_the_extra(folder: Folder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InputError, match=r"needs pyarrow; .*pip install .*\[parquet\]"):
        read_dataset(folder({"run.parquet": b""}))


def test_text_in_a_parquet_column_is_refused(tmp_path: Path) -> None:
    pa = pytest.importorskip("pyarrow")
    pq = pytest.importorskip("pyarrow.parquet")
    table = pa.table({"time_s": [0.0, 1.0], "command_rpm": ["1", "2"], "speed_rpm": [0.0, 1.0]})
    pq.write_table(table, tmp_path / "run.parquet")
    with pytest.raises(InputError, match=r"column 'command_rpm' holds string, must be numbers"):
        read_dataset(tmp_path)


def test_a_parquet_error_names_the_row(tmp_path: Path) -> None:
    pa = pytest.importorskip("pyarrow")
    pq = pytest.importorskip("pyarrow.parquet")
    table = pa.table({"time_s": [0.0, 1.0, 1.0], "command_rpm": [1, 2, 3], "speed_rpm": [0.0, 1.0, 2.0]})
    pq.write_table(table, tmp_path / "run.parquet")
    with pytest.raises(InputError, match=r"run.parquet, row 3: time_s = 1.0 after 1.0"):
        read_dataset(tmp_path)


def test_a_missing_folder_is_refused_with_the_nearest_name(folder: Folder, step: str) -> None:
    path = folder({"run.csv": step})
    with pytest.raises(InputError, match=r'lags: no such file or folder \(did you mean "logs"\?\)'):
        read_dataset(path.with_name("lags"))


def test_the_folder_of_a_checkout_is_told_apart_from_the_packaged_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=r"no such file or folder \(did you mean @examples/logs\?\)"):
        read_dataset(Path("examples/logs"))


def test_a_folder_without_logs_is_refused(folder: Folder) -> None:
    with pytest.raises(InputError, match=r"logs: no logs here; a run is a file that ends in .csv"):
        read_dataset(folder({"notes.txt": "nothing"}))


def test_a_folder_of_datasets_names_them(folder: Folder, step: str) -> None:
    path = folder({"README.md": "two datasets"})
    for name in ("left", "right"):
        (path / name).mkdir()
        (path / name / "run.csv").write_text(step)
    with pytest.raises(InputError, match=r"in its subfolders left, right; .* choose one, such as .*left"):
        read_dataset(path)


def test_a_file_that_is_no_log_is_refused(folder: Folder) -> None:
    with pytest.raises(InputError, match=r"notes.txt: not a log; a run ends in .csv, .csv.gz or .parquet"):
        read_dataset(folder({"notes.txt": "nothing"}) / "notes.txt")


def test_one_run_in_two_formats_is_refused(folder: Folder, step: str) -> None:
    with pytest.raises(InputError, match=r"run.csv and run.csv.gz are one run twice; remove one"):
        read_dataset(folder({"run.csv": step, "run.csv.gz": gzip.compress(step.encode())}))


def test_bench_and_robot_logs_in_one_folder_are_refused(folder: Folder, step: str) -> None:
    with pytest.raises(
        InputError, match=r"a.csv is a bench log and b.csv a robot log; put them in two folders"
    ):
        read_dataset(folder({"a.csv": step, "b.csv": ROBOT}))


def test_a_run_without_a_channel_lists_those_it_has(folder: Folder, step: str) -> None:
    run = read_dataset(folder({"run.csv": step})).runs[0]
    with pytest.raises(
        InputError, match=r'no column speed \(did you mean "speed_rpm"\?\); measured here: speed_rpm'
    ):
        run.channel("speed")
