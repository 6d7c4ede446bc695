"""Logs of other programs: what comes in is what was in them, what goes out comes back the same."""

import json
from pathlib import Path

import numpy as np
import pytest

from mecanum_env.cli import run
from mecanum_env.errors import InputError
from mecanum_env.kinematics import command_to_twist
from mecanum_env.model import Robot
from mecanum_env.units import RAD_S_PER_RPM
from sysid.logs import read_dataset
from sysid.logs.__main__ import export, import_logs, main
from sysid.logs.formats.column_map import parse_map
from sysid.logs.formats.sources import import_source
from sysid.simulate import simulate

EXAMPLES = Path(__file__).parents[2] / "examples" / "gap_logs"
DATE_NS = 1_700_000_000_123_456_789
PLAIN = "time_s,command_rpm,speed_rpm\n0,40,0\n0.1,40,12.5\n0.2,,20.25\n"
ROBOT_LOG = """time_s,command_v_rpm,command_theta_deg,command_vc_rpm,speed_fl_rpm,x_m,y_m,yaw_rad
10,40,0,0,0,0,0,0
10.02,40,0,0,,0.1,0,0.5
10.05,40,90,0,7,0.2,0,1
"""


@pytest.mark.parametrize("separator", [";", "\t"])
def test_a_table_with_decimal_commas_is_the_same_log(separator: str, tmp_path: Path) -> None:
    for name, text in (("plain", PLAIN), ("other", PLAIN.replace(",", separator).replace(".", ","))):
        (tmp_path / name).mkdir()
        (tmp_path / name / "run.csv").write_text(text)
    plain, other = (read_dataset(tmp_path / name).runs[0] for name in ("plain", "other"))
    np.testing.assert_array_equal(other.time_s, plain.time_s)
    np.testing.assert_array_equal(other.channel("speed_rpm"), plain.channel("speed_rpm"))
    np.testing.assert_array_equal(other.command.wheels_rpm, plain.command.wheels_rpm)


def test_a_wrong_cell_of_such_a_table_is_named_with_its_line(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text("time_s;command_rpm;speed_rpm\n0;1;2\n\n0,5;1;x\n")
    with pytest.raises(InputError, match=r"run.csv, line 4: speed_rpm = 'x', must be a number"):
        read_dataset(tmp_path)


def foreign_table(folder: Path, suffix: str) -> Path:
    path = folder / f"drive.{suffix}"
    stamps = DATE_NS + 10_000_000 * np.arange(5)
    if suffix == "parquet":
        pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
        columns = {"stamp": stamps, "goal": np.full(5, 4.0), "omega": np.arange(5.0), "note": ["a"] * 5}
        pq.write_table(pa.table(columns), path)
    else:
        rows = "".join(f"{at};4,0;{k},0;a\n" for k, at in enumerate(stamps))
        path.write_text("stamp;goal;omega;note\n" + rows)
    return path


MAP = ("time_s=stamp:ns", "command_rpm=goal:rad_s", "speed_rpm=omega:rad_s")


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_table_with_other_names_and_units_is_mapped(suffix: str, tmp_path: Path) -> None:
    (one,) = import_source(foreign_table(tmp_path, suffix), None, MAP)
    # Exactly 10 ms: as floats, nanoseconds of today are 256 apart.
    np.testing.assert_array_equal(one.columns["time_s"], 10_000_000 * np.arange(5) * 1e-9)
    np.testing.assert_allclose(one.columns["speed_rpm"], np.arange(5) / RAD_S_PER_RPM)
    assert one.said.startswith("time_s = stamp, command_rpm = goal, speed_rpm = omega")


def test_import_writes_a_folder_that_a_fit_reads(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source, out = foreign_table(tmp_path, "csv"), tmp_path / "logs"
    arguments = [
        "import",
        str(source),
        "--out",
        str(out),
        *(word for item in MAP for word in ("--map", item)),
    ]
    assert main(arguments) == 0
    assert "bench log, 1 run" in capsys.readouterr().out
    assert read_dataset(out).runs[0].file == "drive.csv"


@pytest.mark.parametrize(
    ("items", "message"),
    [
        (("speed_rpm",), "must be OURS=THEIRS or OURS=THEIRS:UNIT"),
        (("sped_rpm=omega",), r'unknown \(did you mean "speed_rpm"\?\)'),
        (("speed_rpm=omega:furlong",), r"unit of speed_rpm = 'furlong', must be rpm, rad_s, deg_s"),
        (
            ("time_s=stamp:ns", "speed_rpm=omga"),
            r'no such column \(did you mean "omega"\?\); there are stamp',
        ),
        (("speed_rpm=omega",), "which column is the time\\? give --map time_s=NAME"),
        (
            ("time_s=stamp:ns",),
            "no column is one of ours; give --map OURS=THEIRS for each; theirs: stamp, goal",
        ),
    ],
)
def test_a_map_that_does_not_fit_is_refused(items: tuple[str, ...], message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        import_source(foreign_table(tmp_path, "csv"), None, items)


def test_a_commanded_twist_becomes_wheel_speeds_of_the_stated_robot(tmp_path: Path) -> None:
    table = tmp_path / "drive.csv"
    table.write_text("t,vx,vy,wz,speed_fl_rpm\n0,0.1,0.02,0.2,0\n0.1,0.1,0.02,0.2,3\n")
    twist = ("command_vx_m_s=vx", "command_vy_m_s=vy", "command_yaw_rate_rad_s=wz")
    items = ("time_s=t", *twist)
    with pytest.raises(InputError, match=r"give --robot FILE, a JSON with wheel_radius_m, half_wheelbase_m"):
        import_source(table, None, items)
    robot = Robot(wheel_radius_m=0.1)
    (one,) = import_source(table, robot, items)
    command = (one.columns[name][0] for name in ("command_v_rpm", "command_theta_deg", "command_vc_rpm"))
    np.testing.assert_allclose(command_to_twist(*command, robot), [0.1, 0.02, 0.2], atol=1e-12)
    with pytest.raises(InputError, match="needs all of command_vx_m_s"):
        import_source(table, robot, items[:2])


def test_a_mapped_name_may_hold_colons_only_before_a_unit() -> None:
    assert parse_map(["speed_rpm=/a.b"])["speed_rpm"].theirs == "/a.b"
    assert parse_map(["speed_rpm=a:b:rad_s"])["speed_rpm"].theirs == "a:b"


def robot_log(folder: Path) -> Path:
    folder.mkdir()
    (folder / "drive.csv").write_text(ROBOT_LOG)
    return folder


def same(ours: Path, theirs: Path) -> None:
    for one, other in zip(read_dataset(ours).runs, read_dataset(theirs).runs, strict=True):
        np.testing.assert_allclose(one.time_s, other.time_s, rtol=0, atol=1e-9)
        np.testing.assert_array_equal(one.command.wheels_rpm, other.command.wheels_rpm)
        assert dict(one.channels).keys() == dict(other.channels).keys()
        for name, values in one.channels.items():
            np.testing.assert_array_equal(values, other.channels[name])


def test_mcap_comes_back_the_same(tmp_path: Path) -> None:
    reader = pytest.importorskip("mcap.reader")
    logs = robot_log(tmp_path / "logs")
    export(logs, out=tmp_path / "mcap")
    with (tmp_path / "mcap" / "drive.mcap").open("rb") as stream:
        found = list(reader.make_reader(stream).iter_messages())
    assert {(schema.name, schema.encoding, channel.message_encoding) for schema, channel, _ in found} == {
        ("mecanum.Command", "jsonschema", "json"),
        ("mecanum.Measured", "jsonschema", "json"),
        ("foxglove.PoseInFrame", "jsonschema", "json"),
    }
    assert found[0][2].log_time == 10_000_000_000
    import_logs((tmp_path / "mcap" / "drive.mcap",), out=tmp_path / "back")
    same(logs, tmp_path / "back")


def test_mcap_of_other_programs_is_mapped_by_field(tmp_path: Path) -> None:
    writer_module = pytest.importorskip("mcap.writer")
    path = tmp_path / "other.mcap"
    with path.open("wb") as stream:
        writer = writer_module.Writer(stream)
        writer.start()
        schema = writer.register_schema(name="w", encoding="jsonschema", data=b'{"type": "object"}')
        channel = writer.register_channel(schema_id=schema, topic="/wheel", message_encoding="json")
        for k in range(3):
            text = json.dumps({"goal": 4.0, "state": {"omega": [k, 0]}, "name": "a"})
            writer.add_message(channel, DATE_NS + k, text.encode(), DATE_NS + k)
        writer.finish()
    (one,) = import_source(path, None, ("command_rpm=/wheel.goal", "speed_rpm=/wheel.state.omega.0:rad_s"))
    np.testing.assert_array_equal(one.columns["time_s"], np.arange(3) * 1e-9)
    np.testing.assert_allclose(one.columns["speed_rpm"], np.arange(3) / RAD_S_PER_RPM)


def test_a_damaged_mcap_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("mcap")
    (tmp_path / "a.mcap").write_bytes(b"\x89MCAP0\r\n and nothing more")
    with pytest.raises(InputError, match=r"a\.mcap: cannot be read as MCAP"):
        import_source(tmp_path / "a.mcap", None)


def test_parquet_comes_back_the_same(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    logs = robot_log(tmp_path / "logs")
    export(logs, out=tmp_path / "out", to="parquet")
    same(logs, tmp_path / "out")


def test_a_lerobot_dataset_comes_back_at_its_rate(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    export(EXAMPLES, out=tmp_path / "data", to="lerobot", fps=100)
    import_logs((tmp_path / "data",), out=tmp_path / "back")
    ours, theirs = read_dataset(EXAMPLES).runs, read_dataset(tmp_path / "back").runs
    assert len(ours) == len(theirs)
    for one, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(np.diff(other.time_s), 0.01, atol=1e-9)
        expected = np.interp(other.time_s, one.time_s, one.channel("speed_rpm"))
        np.testing.assert_allclose(other.channel("speed_rpm"), expected, rtol=1e-6, atol=1e-4)


def test_a_lerobot_dataset_has_the_layout_of_version_3(tmp_path: Path) -> None:
    pq = pytest.importorskip("pyarrow.parquet")
    data = tmp_path / "data"
    export(robot_log(tmp_path / "logs"), out=data, to="lerobot", fps=50)
    info = json.loads((data / "meta" / "info.json").read_text())
    assert (info["codebase_version"], info["total_episodes"], info["total_frames"]) == ("v3.0", 1, 3)
    assert info["features"]["action"]["names"] == ["command_v_rpm", "command_theta_deg", "command_vc_rpm"]
    frames = pq.read_table(data / info["data_path"].format(chunk_index=0, file_index=0))
    assert frames["action"].to_pylist() == [[40.0, 0.0, 0.0], [40.0, 0.0, 0.0], [40.0, 0.0, 0.0]]
    assert set(info["features"]) == set(frames.column_names)
    (episode,) = pq.read_table(data / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert (episode["length"], episode["dataset_to_index"], episode["tasks"]) == (3, 3, ["drive"])
    with pytest.raises(InputError, match="is not an empty folder"):
        export(tmp_path / "logs", out=data, to="lerobot")


def test_a_lerobot_dataset_of_version_2_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta" / "info.json").write_text('{"codebase_version": "v2.1", "fps": 30, "features": {}}')
    with pytest.raises(InputError, match=r"codebase_version = v2.1, must be v3; LeRobot converts older ones"):
        import_source(tmp_path, None)


def test_a_simulated_run_has_the_form_of_the_logged_one(tmp_path: Path, paper) -> None:
    from mecanum_env.model import write_model

    (tmp_path / "logs").mkdir()
    (tmp_path / "logs" / "steps_1.csv").write_bytes((EXAMPLES / "steps_1.csv").read_bytes())
    write_model(paper, tmp_path / "model.json")
    simulate(tmp_path / "logs", model=tmp_path / "model.json", out=tmp_path / "simulated")
    (logged,), (made,) = (read_dataset(tmp_path / name).runs for name in ("logs", "simulated"))
    np.testing.assert_array_equal(made.time_s, logged.time_s)
    np.testing.assert_array_equal(made.command.wheels_rpm, logged.command.wheels_rpm)
    assert np.max(np.abs(made.channel("speed_rpm"))) > 10.0
    assert run(simulate, [str(tmp_path / "logs"), "--model", str(tmp_path / "model.json"), "--out",
                          str(tmp_path / "simulated")]) == 2  # fmt: skip
