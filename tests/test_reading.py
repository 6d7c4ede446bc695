"""What hostile files do to the readers: one sentence each, in little time and memory."""

import json
import os
import time
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.files import asset_path
from mecanum_env.model import read_model, read_robot
from mecanum_env.simulator import read_commands
from mecanum_env.tables import read_table
from mecanum_env.tankendo.actions import checked_action
from sysid.logs import read_dataset
from training.certify.certificate import read_certificate
from training.controllers.policy import bundled, load_policy

LOG = "time_s,command_rpm,speed_rpm\n0,0,0\n0.1,1,1\n0.2,1,1\n"

JSON = {
    "brackets": "[" * 20_000,
    "objects": '{"a":' * 20_000,
    "400 digits": '{"robot": {"rollers_per_wheel": ' + "9" * 400 + "}}",
    "5000 digits": '{"mass_kg": ' + "9" * 5000 + "}",
    "1e999": '{"mass_kg": 1e999}',
    "torn": '{"mass_kg": ',
    "not text": b"\xff\xfe\x00",
    "zero bytes": b"\0" * 100,
    "empty": "",
}


@pytest.mark.parametrize("case", JSON)
@pytest.mark.parametrize("read", [read_model, read_robot, read_certificate])
def test_json_that_cannot_be_is_refused(case, read, tmp_path):
    path = tmp_path / "a.json"
    data = JSON[case]
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    with pytest.raises(InputError) as refusal:
        read(path)
    assert str(refusal.value).startswith(str(path))
    assert len(str(refusal.value)) < 500


TOML = {
    "dots": "a" + ".a" * 20_000 + " = 1",
    "dots of a table": "[a" + ".a" * 20_000 + "]",
    "quoted dots": "'a'" + ".'a'" * 20_000 + " = 1",
    "spaced dots": "a" + " . a" * 20_000 + " = 1",
    "brackets": "a = " + "[" * 20_000,
    "tables": "a = " + "{a = " * 20_000,
    "400 digits": "[columns]\nspeed_rpm = {from = 'w', scale = " + "9" * 400 + "}",
    "5000 digits": "a = " + "9" * 5000,
    "1e999": "[columns]\nspeed_rpm = {from = 'w', scale = 1e999}",
    "not closed": '[dataset]\nname = "' + '\\"' * 200_000,
}


@pytest.mark.parametrize("case", TOML)
def test_a_dataset_toml_that_cannot_be_is_refused(case, tmp_path):
    (tmp_path / "a.csv").write_text(LOG)
    (tmp_path / "dataset.toml").write_text(TOML[case])
    with pytest.raises(InputError, match=r"dataset\.toml") as refusal:
        read_dataset(tmp_path)
    assert len(str(refusal.value)) < 500


def test_a_text_with_many_dots_is_a_text(tmp_path):
    (tmp_path / "a.csv").write_text(LOG)
    (tmp_path / "dataset.toml").write_text(f'[dataset]\nname = "{"a." * 200}"\n# {"b." * 40}\n')
    assert read_dataset(tmp_path).name == "a." * 200


@pytest.mark.parametrize("name", ["dataset.toml", "b.csv"])
def test_a_pipe_is_not_waited_for(name, tmp_path):
    (tmp_path / "a.csv").write_text(LOG)
    os.mkfifo(tmp_path / name)
    if name == "b.csv":  # only plain files of a folder are runs
        assert len(read_dataset(tmp_path).runs) == 1
        with pytest.raises(InputError, match="not a plain file"):
            read_table(tmp_path / name)
    else:
        with pytest.raises(InputError, match=r"dataset\.toml: not a plain file"):
            read_dataset(tmp_path)


@pytest.mark.parametrize("read", [read_model, read_robot, read_certificate, load_policy])
def test_pipes_devices_and_folders_are_no_files(read, tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path in (pipe, Path("/dev/zero"), tmp_path):
        with pytest.raises(InputError):
            read(path)


@pytest.mark.parametrize("name", ["a\0b", "x" * 300, "\udcff", "a\0b.csv", "a\nb"])
@pytest.mark.parametrize(
    "read", [read_model, read_robot, read_certificate, load_policy, read_dataset, read_commands]
)
def test_names_that_no_file_has_are_refused(read, name, tmp_path):
    for path in (name, tmp_path / name):
        with pytest.raises(InputError):
            read(Path(path))


def test_a_file_whose_name_is_no_text_is_a_run(tmp_path):
    folder = os.fsencode(tmp_path) + b"/\xff"
    os.mkdir(folder)
    with open(folder + b"/\xfe.csv", "w") as file:
        file.write(LOG)
    found = read_dataset(os.fsdecode(folder))
    assert len(found.runs) == 1


def test_a_log_of_400_digits_is_refused(tmp_path):
    (tmp_path / "a.csv").write_text(LOG + f"0.3,{'9' * 400},0\n")
    with pytest.raises(InputError, match="must be a finite number"):
        read_dataset(tmp_path)


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ("x" * 200_000, "has a name of 200000 characters|not CSV"),
        ('"' + "x" * 200_000, "not CSV"),
        (",".join(f"c{i}" for i in range(20_000)), "20000 columns, must be at most"),
        ("," * 200_000, "is a row of numbers"),
    ],
)
def test_a_header_of_200_kilobytes_is_refused(header, said, tmp_path):
    (tmp_path / "a.csv").write_text(f"{header}\n1,2\n2,3\n")
    with pytest.raises(InputError, match=said) as refusal:
        read_dataset(tmp_path)
    assert len(str(refusal.value)) < 1000


def test_columns_are_compared_once():
    """A name that is far too long has no near one, which takes the square of its length to find out."""
    begun = time.process_time()
    assert did_you_mean("x" * 1_000_000, ["speed_rpm"] * 100) == ""
    assert time.process_time() - begun < 5.0


@pytest.mark.parametrize("stamp", ["1e9", "1e300"])
def test_one_wrong_stamp_in_a_command_file_is_named(stamp, tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(
        f"time_s,command_v_rpm,command_theta_deg,command_vc_rpm\n0,1,0,0\n1,1,0,0\n{stamp},1,0,0\n"
    )
    with pytest.raises(InputError, match=r"a\.csv, line 4: time_s jumps from 1\.0 to"):
        read_commands(path)


def test_a_packed_file_that_grows_without_end_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("mecanum_env.tables._MOST_BYTES", 1_000_000)
    packer = zlib.compressobj(9, wbits=31)
    block = b"0" * 1_000_000
    (tmp_path / "a.csv.gz").write_bytes(b"".join(packer.compress(block) for _ in range(50)) + packer.flush())
    with pytest.raises(InputError, match="more than 1000000 bytes unpacked; split the run"):
        read_dataset(tmp_path)


def test_nanoseconds_beyond_double_precision_are_named(tmp_path):
    pa = pytest.importorskip("pyarrow")
    pq = pytest.importorskip("pyarrow.parquet")
    stamps = pa.array([2**60, 2**60 + 1], pa.int64())
    pq.write_table(pa.table({"time_s": stamps, "command_rpm": [0, 1], "speed_rpm": [0.0, 1.0]}),
                   tmp_path / "a.parquet")  # fmt: skip
    with pytest.raises(InputError, match=r"a\.parquet, row 1: time_s = \d+, must be at most 2\^53"):
        read_dataset(tmp_path)


def test_whole_numbers_of_a_parquet_file_are_read_exactly(tmp_path):
    pa = pytest.importorskip("pyarrow")
    pq = pytest.importorskip("pyarrow.parquet")
    numbers = pa.array([2**53, -(2**53), None], pa.int64())
    pq.write_table(pa.table({"a": numbers, "b": pa.array([1, 2, 3], pa.uint8())}), tmp_path / "a.parquet")
    values = read_table(tmp_path / "a.parquet").column("a")
    assert values[:2].tolist() == [2.0**53, -(2.0**53)]
    assert values[2] != values[2]


def test_a_small_parquet_file_of_many_rows_is_refused(tmp_path, monkeypatch):
    pa = pytest.importorskip("pyarrow")
    pq = pytest.importorskip("pyarrow.parquet")
    monkeypatch.setattr("mecanum_env.tables._MOST_CELLS", 1000)
    pq.write_table(pa.table({"a": [0.0] * 2000}), tmp_path / "a.parquet")
    with pytest.raises(InputError, match="2000 rows of 1 columns, must be at most 1000 cells"):
        read_table(tmp_path / "a.parquet")


def test_the_packaged_model_is_read():
    assert json.loads(asset_path("models/paper.json").read_text())["format"]
    assert read_model(asset_path("models/paper.json")).wheel.law.is_stable


def policy_with(path, change):
    """Write the packaged policy to a path after a change of its arrays and its description."""
    with np.load(bundled()) as stored:
        arrays = {name: stored[name] for name in stored.files}
    about = json.loads(str(arrays["about"]))
    change(arrays, about)
    np.savez(path, **{**arrays, "about": np.array(json.dumps(about))})
    return path


POLICIES = {
    "stack 0": lambda _, about: about.update(stack=0),
    "stack 2.5": lambda _, about: about.update(stack=2.5),
    "stack true": lambda _, about: about.update(stack=True),
    "layers 2.5": lambda _, about: about.update(layers=2.5),
    "layers 1e9": lambda _, about: about.update(layers=10**9),
    "clip NaN": lambda _, about: about.update(clip=float("nan")),
    "clip 0": lambda _, about: about.update(clip=0.0),
    "clip text": lambda _, about: about.update(clip="x"),
    "activation list": lambda _, about: about.update(activation=["tanh"]),
    "mode list": lambda _, about: about.update(action_mode=["polar"]),
    "squashes text": lambda _, about: about.update(squashes="no"),
    "quantum text": lambda _, about: about.update(command_quantum_rpm="x"),
    "quantum list": lambda _, about: about.update(command_quantum_rpm=[1.0]),
    "quantum NaN": lambda _, about: about.update(command_quantum_rpm=float("nan")),
    "scale 0": lambda arrays, _: arrays["scale"].fill(0.0),
    "scale infinite": lambda arrays, _: arrays["scale"].fill(np.inf),
    "complex mean": lambda arrays, _: arrays.update(mean=arrays["mean"] * 1j),
    "text mean": lambda arrays, _: arrays.update(mean=arrays["mean"].astype(str)),
    "no mean": lambda arrays, _: arrays.pop("mean"),
    "no inputs": lambda arrays, _: arrays.update(mean=np.zeros(0), scale=np.zeros(0)),
    "huge weights": lambda arrays, about: arrays.update(
        {
            f"bias_{about['layers'] - 1}": np.full(3, 1e308),
            f"weight_{about['layers'] - 1}": np.full((3, 64), 1e308),
        }
    ),
}


@pytest.mark.parametrize("case", POLICIES)
def test_a_policy_that_cannot_act_does_not_load(case, tmp_path):
    path = policy_with(tmp_path / "policy.npz", POLICIES[case])
    with pytest.raises(InputError) as refusal:
        load_policy(path)
    assert str(refusal.value).startswith(str(path))


def test_a_policy_that_unpacks_to_gigabytes_does_not_load(tmp_path):
    path = tmp_path / "policy.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("mean.npy", bytes((1 << 28) + 1))
    with pytest.raises(InputError, match="no policy file, or a torn one"):
        load_policy(path)


def test_arrays_whose_header_never_ends_are_refused(tmp_path):
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (3,"
    path = tmp_path / "policy.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("mean.npy", b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header)
    with pytest.raises(InputError, match="no policy file, or a torn one"):
        load_policy(path)


@pytest.mark.parametrize(
    "action", [[1j, 0, 0], ["0", "0", "0"], [b"0", b"0", b"0"], [None, 0, 0], np.array(["0"] * 3, object)]
)
def test_an_action_that_is_no_real_number_is_refused(action):
    with pytest.raises(InputError, match="action must be numbers, an array of shape"):
        checked_action(action, (3,))
