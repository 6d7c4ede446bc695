"""Bags of all three kinds, written with rosbags and imported."""

import json
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.kinematics import command_to_twist
from mecanum_env.model import Robot
from mecanum_env.units import RAD_S_PER_RPM
from sysid.logs import BodyCommand, WheelCommand, read_dataset
from sysid.logs.__main__ import import_logs, main
from sysid.logs.formats.bags import import_bag

rosbag1 = pytest.importorskip("rosbags.rosbag1")
rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")

KINDS = ("ros1", "mcap", "sqlite3")
JOINTS = ("arm_joint", "rear_right_wheel", "front_left_wheel", "rear_left_wheel", "front_right_wheel")
Message = tuple[str, str, int, Any]
"""Topic, type, time of receipt [ns], fields."""

START = 1_700_000_000_000_000_000


def fill(store: Any, kind: str, fields: dict[str, Any]) -> Any:
    """Build a message from the fields that matter; the rest is zero or empty."""
    cls = store.types[kind]
    values = {}
    for name, (node, desc) in store.fielddefs[kind][1]:
        given = fields.get(name)
        if node == typesys.base.Nodetype.NAME:
            values[name] = fill(store, desc, given or {})
        elif node == typesys.base.Nodetype.BASE:
            values[name] = given if given is not None else "" if desc[0] == "string" else 0
        else:
            base, length = desc
            if base[0] == typesys.base.Nodetype.NAME or base[1][0] == "string":
                values[name] = list(given) if given is not None else []
            else:
                dtype = np.dtype(base[1][0])
                values[name] = np.array(given if given is not None else [0] * length, dtype)
    return cls(**values)


def stamp(nanoseconds: int) -> dict[str, Any]:
    return {"header": {"stamp": {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}}}


@pytest.fixture
def write_bag(tmp_path: Path) -> Callable[[str, Sequence[Message]], Path]:
    """Write messages as a bag of one kind and return its path."""

    def write(kind: str, messages: Sequence[Message]) -> Path:
        if kind == "ros1":
            store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
            path = tmp_path / "drive.bag"
            writer, serialize = rosbag1.Writer(path), store.serialize_ros1
        else:
            store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
            path = tmp_path / f"drive_{kind}"
            plugin = rosbag2.StoragePlugin[kind.upper()]
            writer = rosbag2.Writer(path, version=9, storage_plugin=plugin)
            serialize = store.serialize_cdr
        with writer:
            connections = {}
            for topic, msgtype, at, fields in messages:
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, msgtype, typestore=store)
                data = serialize(fill(store, msgtype, fields), msgtype)
                writer.write(connections[topic], at, data)
        return path

    return write


def joint_state(at: int, rpm: Sequence[float], late: int = 0) -> Message:
    """Wheel speeds in the order fl, fr, rl, rr, with an arm joint among them."""
    order = {"front_left": 0, "front_right": 1, "rear_left": 2, "rear_right": 3}
    speeds = [0.5 if name == "arm_joint" else rpm[order[name[:-6]]] * RAD_S_PER_RPM for name in JOINTS]
    fields = {**stamp(at), "name": JOINTS, "position": [0.0] * 5, "velocity": speeds}
    return "/joint_states", "sensor_msgs/msg/JointState", at + late, fields


def twist(at: int, vx: float, vy: float, wz: float) -> Message:
    fields = {"linear": {"x": vx, "y": vy, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": wz}}
    return "/cmd_vel", "geometry_msgs/msg/Twist", at, fields


def odom(at: int, vx: float, yaw: float) -> Message:
    fields = {
        **stamp(at),
        "twist": {"twist": {"linear": {"x": vx, "y": 0.1, "z": 0.0}, "angular": {"z": 0.3}}},
        "pose": {
            "pose": {
                "position": {"x": 1.0, "y": 2.0, "z": 0.0},
                "orientation": {"x": 0.0, "y": 0.0, "z": np.sin(yaw / 2), "w": np.cos(yaw / 2)},
            }
        },
    }
    return "/odom", "nav_msgs/msg/Odometry", at, fields


def imu(at: int, rate: float) -> Message:
    return "/imu", "sensor_msgs/msg/Imu", at, {**stamp(at), "angular_velocity": {"z": rate}}


def battery(at: int, voltage: float) -> Message:
    return "/battery", "sensor_msgs/msg/BatteryState", at, {**stamp(at), "voltage": voltage}


def number(topic: str, at: int, value: float) -> Message:
    return topic, "std_msgs/msg/Float64", at, {"data": value}


MS = 1_000_000


def dimensions(folder: Path) -> Path:
    """Write the packaged robot's dimensions and return their file."""
    path = folder / "robot.json"
    names = ("wheel_radius_m", "half_wheelbase_m", "half_track_m")
    path.write_text(json.dumps({name: getattr(Robot(), name) for name in names}))
    return path


def drive() -> list[Message]:
    messages = []
    for k in range(20):
        at = START + 50 * MS * k
        if k % 2 == 0:
            messages.append(twist(at, 0.1 * (k >= 4), 0.02, 0.2))
        messages.append(joint_state(at + 3 * MS, (k, -k, 2.0 * k, 10.0)))
        messages.append(odom(at + 5 * MS, 0.01 * k, 0.3 * k))
        messages.append(imu(at + 5 * MS, 0.02 * k))
    messages.append(battery(START + 400 * MS, 24.5))
    return sorted(messages, key=lambda m: m[2])


@pytest.mark.parametrize("kind", KINDS)
def test_a_drive_is_imported_with_units_names_and_axes(
    kind: str, write_bag: Callable[..., Path], tmp_path: Path
) -> None:
    import_logs((write_bag(kind, drive()),), out=tmp_path / "logs", robot=dimensions(tmp_path))
    (run,) = read_dataset(tmp_path / "logs").runs
    assert isinstance(run.command, BodyCommand)
    asked = command_to_twist(run.command.v_rpm, run.command.theta_deg, run.command.vc_rpm, Robot())
    np.testing.assert_allclose(asked[-1], [0.1, 0.02, 0.2], atol=1e-12)
    np.testing.assert_allclose(asked[0], [0.0, 0.02, 0.2], atol=1e-12)
    wheels = run.finite("speed_fl_rpm")
    k = np.arange(20)
    np.testing.assert_allclose(run.time_s[wheels], 0.003 + 0.05 * k, atol=1e-9)
    for name, expected in (("fl", k), ("fr", -k), ("rl", 2 * k), ("rr", 10 + 0 * k)):
        np.testing.assert_allclose(run.channel(f"speed_{name}_rpm")[wheels], expected, atol=1e-12)
    body = run.finite("vx_m_s")
    np.testing.assert_allclose(run.channel("vx_m_s")[body], 0.01 * k)
    np.testing.assert_allclose(run.channel("yaw_rad")[body], 0.3 * k, atol=1e-12)
    # The gyroscope's yaw rate, not odometry's.
    np.testing.assert_allclose(run.channel("yaw_rate_rad_s")[body], 0.02 * k)
    assert run.finite("battery_v").sum() == 1


def test_a_command_lasts_until_the_next_one(write_bag: Callable[..., Path], tmp_path: Path) -> None:
    import_logs((write_bag("mcap", drive()),), out=tmp_path / "logs", robot=dimensions(tmp_path))
    (run,) = read_dataset(tmp_path / "logs").runs
    times, wheels = run.command_changes()
    np.testing.assert_allclose(times, [0.0, 0.2], atol=1e-9)
    assert wheels.shape == (2, 4)


def test_wheel_commands_come_from_an_array(write_bag: Callable[..., Path], tmp_path: Path) -> None:
    topic, kind = "/commands", "std_msgs/msg/Float64MultiArray"
    messages = [(topic, kind, START, {"data": [1.0, 2.0, 3.0, 4.0]})]
    messages += [joint_state(START + 10 * MS * k, (1, 2, 3, 4)) for k in range(1, 5)]
    bag = write_bag("mcap", messages)
    import_logs((bag,), out=tmp_path / "logs", map=("wheel_commands=/commands",), unit="rad_s")
    (run,) = read_dataset(tmp_path / "logs").runs
    assert isinstance(run.command, WheelCommand)
    np.testing.assert_allclose(run.command.wheels_rpm[-1], np.array([1, 2, 3, 4]) / RAD_S_PER_RPM)


def test_a_bench_run_comes_from_two_numbers(write_bag: Callable[..., Path], tmp_path: Path) -> None:
    messages = [number("/cmd", START, 40.0)] + [
        number("/rpm", START + 10 * MS * k, 4.0 * k) for k in range(1, 9)
    ]
    bag = write_bag("sqlite3", messages)
    import_logs((bag,), out=tmp_path / "logs", map=("command_rpm=/cmd", "speed_rpm=/rpm"), unit="rpm")
    data = read_dataset(tmp_path / "logs")
    assert data.level == "bench"
    np.testing.assert_array_equal(data.runs[0].channel("speed_rpm")[1:], 4.0 * np.arange(1, 9))
    np.testing.assert_array_equal(data.runs[0].command.wheels_rpm[:, 0], 40.0)


def test_a_bench_speed_may_be_a_joint(write_bag: Callable[..., Path]) -> None:
    messages = [
        number("/cmd", START, 40.0),
        *(joint_state(START + 10 * MS * k, (1, 2, 3, 4)) for k in range(1, 4)),
    ]
    bag = write_bag("mcap", messages)
    roles = ("command_rpm=/cmd", "speed_rpm=/joint_states")
    got = import_bag(bag, Robot(), topic_map=(*roles, "joint=rear_left_wheel"), unit="rpm").columns
    np.testing.assert_allclose(got["speed_rpm"][1:], 3.0)
    with pytest.raises(
        InputError, match="which joint\\? give --map joint=NAME; joints: arm_joint, rear_right"
    ):
        import_bag(bag, Robot(), topic_map=roles, unit="rpm")


def test_headers_stamp_the_samples_unless_their_clock_is_another(write_bag: Callable[..., Path]) -> None:
    near = [
        twist(START, 0.1, 0, 0),
        *(joint_state(START + 10 * MS * k, (1, 1, 1, 1), 4 * MS) for k in range(1, 4)),
    ]
    got = import_bag(write_bag("mcap", near), Robot())
    assert got.clock == "header"
    np.testing.assert_allclose(got.columns["time_s"], [0.0, 0.01, 0.02, 0.03], atol=1e-9)
    far = [twist(START, 0.1, 0, 0)]
    far += [joint_state(START + 10 * MS * k - 10**12, (1, 1, 1, 1), 10**12 + 4 * MS) for k in range(1, 4)]
    got = import_bag(write_bag("sqlite3", far), Robot())
    assert got.clock == "receive"
    np.testing.assert_allclose(got.columns["time_s"], [0.0, 0.014, 0.024, 0.034], atol=1e-9)


def test_messages_with_only_other_joints_are_ignored(write_bag: Callable[..., Path]) -> None:
    at = START + 15 * MS
    fields = {**stamp(at), "name": ["arm_joint"], "position": [0.0], "velocity": [1.0]}
    arm = ("/joint_states", "sensor_msgs/msg/JointState", at, fields)
    messages = [twist(START, 0.1, 0, 0), joint_state(START + 10 * MS, (1, 2, 3, 4)), arm]
    got = import_bag(write_bag("mcap", messages), Robot()).columns
    np.testing.assert_allclose(got["speed_fr_rpm"], [np.nan, 2.0, np.nan])


def renamed(message: Message, topic: str) -> Message:
    return (topic, *message[1:])


REFUSED: dict[str, tuple[list[Message], tuple[str, ...], str]] = {
    "two odometries": (
        [*drive(), renamed(odom(START, 0, 0), "/odom2")],
        (),
        r"2 topics could be odometry; choose with --map odometry=/odom \(or odometry=none\); topics: /b",
    ),
    "no command": (
        [imu(START, 0.1)],
        (),
        r"no command found; give --map command=TOPIC .*; topics: /imu",
    ),
    "nothing measured": ([twist(START, 0, 0, 0)], (), r"nothing measured found .*; topics: /cmd_vel"),
    "no such topic": (drive(), ("imu=/imo",), r'no topic /imo \(did you mean "/imu"\?\); topics:'),
    "wrong type": (
        drive(),
        ("imu=/odom",),
        r"/odom is nav_msgs/msg/Odometry, but imu must be sensor_msgs/msg/Imu",
    ),
    "unknown role": (
        drive(),
        ("odomtry=/odom",),
        r'unknown \(did you mean "odometry"\?\); known: command, wheel_',
    ),
    "no equals": (drive(), ("/odom",), r"--map '/odom': must be ROLE=TOPIC"),
    "no unit": (
        [number("/cmd", START, 1.0), number("/rpm", START + MS, 1.0)],
        ("command_rpm=/cmd", "speed_rpm=/rpm"),
        r"/cmd: std_msgs numbers carry no unit; give --unit rpm or --unit rad_s",
    ),
    "half a bench": (
        [number("/cmd", START, 1.0), number("/rpm", START + MS, 1.0)],
        ("command_rpm=/cmd",),
        r"a bench log needs speed_rpm too; give --map speed_rpm=TOPIC; topics: /cmd",
    ),
    "unknown joint": (
        drive(),
        ("fl=wheel_9",),
        r"no joint for wheel fl; give --map fl=JOINT; joints: arm_joint",
    ),
    "no velocities": (
        [
            twist(START, 0, 0, 0),
            (
                "/joint_states",
                "sensor_msgs/msg/JointState",
                START,
                {**stamp(START), "name": JOINTS, "velocity": []},
            ),
        ],
        (),
        r"/joint_states: 5 joints and 0 velocities; the driver must publish velocities",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_imported_is_refused(case: str, write_bag: Callable[..., Path]) -> None:
    messages, items, message = REFUSED[case]
    bag = write_bag("mcap", sorted(messages, key=lambda m: m[2]))
    with pytest.raises(InputError, match=message):
        import_bag(bag, Robot(), topic_map=items)


def test_a_role_may_be_left_out(write_bag: Callable[..., Path]) -> None:
    got = import_bag(write_bag("mcap", drive()), Robot(), topic_map=("imu=none", "battery=none")).columns
    assert "battery_v" not in got
    np.testing.assert_allclose(got["yaw_rate_rad_s"][np.isfinite(got["yaw_rate_rad_s"])], 0.3)


def test_a_file_inside_a_bag_stands_for_it(write_bag: Callable[..., Path]) -> None:
    bag = write_bag("mcap", drive())
    assert "vx_m_s" in import_bag(next(bag.glob("*.mcap")), Robot()).columns


@pytest.mark.parametrize("kind", KINDS)
def test_a_damaged_bag_is_refused(kind: str, write_bag: Callable[..., Path]) -> None:
    bag = write_bag(kind, drive())
    file = bag if kind == "ros1" else next(p for p in bag.iterdir() if p.suffix in (".mcap", ".db3"))
    file.write_bytes(file.read_bytes()[:300])
    with pytest.raises(InputError, match="cannot be read as a ROS bag"):
        import_bag(bag, Robot())


def test_a_path_that_is_not_a_bag_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such bag"):
        import_bag(tmp_path / "absent.bag", Robot())
    with pytest.raises(InputError, match=r"no metadata.yaml, so no ROS 2 bag; `ros2 bag reindex` writes one"):
        import_bag(tmp_path, Robot())


def test_without_rosbags_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "rosbags.highlevel", None)
    with pytest.raises(InputError, match=r"needs rosbags; .*pip install .*\[bag\]"):
        import_bag(tmp_path / "a.bag", Robot())


def test_a_twist_needs_the_robots_dimensions(write_bag: Callable[..., Path], tmp_path: Path) -> None:
    bag = write_bag("mcap", drive())
    with pytest.raises(InputError, match=r"/cmd_vel: a Twist becomes wheel speeds .*give --robot FILE"):
        import_bag(bag, None)
    robot = tmp_path / "robot.json"
    robot.write_text('{"wheel_radius_m": 0.1}')
    with pytest.raises(InputError, match=r"half_wheelbase_m, half_track_m is missing; measure it"):
        import_logs((bag,), out=tmp_path / "logs", robot=robot)


def test_an_mcap_file_without_its_bag_says_the_same(write_bag: Callable[..., Path], tmp_path: Path) -> None:
    pytest.importorskip("mcap")
    bag = write_bag("mcap", drive())
    alone = shutil.copy(next(bag.glob("*.mcap")), tmp_path / "alone.mcap")
    ours, theirs = import_bag(Path(alone), Robot()).columns, import_bag(bag, Robot()).columns
    assert list(ours) == list(theirs)
    for name, values in theirs.items():
        np.testing.assert_array_equal(ours[name], values)


def test_import_from_the_command_line(
    write_bag: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag, out = write_bag("ros1", drive()), tmp_path / "logs"
    arguments = ["import", str(bag), "--out", str(out), "--robot", str(dimensions(tmp_path))]
    arguments += ["--map", "imu=none", "--map", "battery=none"]
    assert main(arguments) == 0
    assert "command = /cmd_vel" in capsys.readouterr().out
    assert sorted(p.name for p in out.iterdir()) == ["dataset.toml", "drive.csv", "mecanum-output.json"]
    assert main(arguments) == 2
    assert "drive.csv: exists already; choose another --out" in capsys.readouterr().err
