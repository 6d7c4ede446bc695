"""Random and mangled files: every reader reads or refuses in one sentence, within a cap of time and memory.

2,000 inputs here; `make fuzz` tries fifty times as many.
"""

import os
import resource
import signal
import string
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mecanum_env.errors import InputError
from mecanum_env.files import asset_path
from mecanum_env.model import read_model, read_robot
from mecanum_env.simulator import read_commands
from mecanum_env.tables import read_table
from mecanum_env.wheel_drive.formula import compile_formula
from sysid.logs import read_dataset
from training.certify.certificate import read_certificate
from training.controllers.policy import bundled, load_policy

TIMES = int(os.environ.get("MECANUM_FUZZ", "1"))
MOST_S = 10
MOST_BYTES = 1 << 30
LOG = b"time_s,command_rpm,speed_rpm\n0,0,0\n0.1,10,1\n0.2,10,5\n0.3,10,8\n"
DRIVE = b"time_s,command_v_rpm,command_theta_deg,command_vc_rpm\n0,1,2,3\n1,,4,5\n"
TOML = b"[dataset]\nname = 'x'\n[columns]\nspeed_rpm = {from = 'w', scale = 2.0}\n[[runs]]\nfile = 'a.csv'\n"
WORDS = (
    b"nan", b"inf", b"-inf", b"1e999", b"9" * 400, b"9" * 5000, b"[" * 3000, b"{" * 3000, b"a." * 3000, b"\0",
    b"\xff", b'"', b"'", b",", b"\n", b"\r", b";", b"=", b"-", b"0x1", b"1_0", b"null", b"true", b"{}", b"[]",
    b'"\\ud800"', b"1e-999", b"\xef\xbb\xbf", b"time_s", b"speed_rpm", b"#", b"<script>", b"x" * 2000,
)  # fmt: skip
READERS: dict[str, tuple[str, bytes, Callable[[Path], object]]] = {
    "log": ("a.csv", LOG, lambda path: read_dataset(path.parent)),
    "table": ("a.csv", LOG, read_table),
    "packed": ("a.csv.gz", b"\x1f\x8b\x08\0\0\0\0\0\0\3" + LOG, read_table),
    "parquet": ("a.parquet", b"PAR1" + LOG + b"PAR1", read_table),
    "commands": ("a.csv", DRIVE, read_commands),
    "settings": ("dataset.toml", TOML, lambda path: read_dataset(path.parent)),
    "model": ("model.json", asset_path("models/paper.json").read_bytes(), read_model),
    "robot": ("robot.json", b'{"mass_kg": 20.0, "wheel_radius_m": 0.05, "rollers_per_wheel": 9}', read_robot),
    "certificate": ("c.json", b'{"format": "mecanum-certificate/1", "passed": true}', read_certificate),
    "policy": ("policy.npz", bundled().read_bytes(), load_policy),
}


@st.composite
def mangled(draw: st.DrawFn, whole: bytes) -> bytes:
    """Draw a file: the whole one after a few cuts, insertions, repetitions and changes, or plain noise."""
    if draw(st.integers(0, 9)) == 0:
        return draw(st.binary(max_size=200))
    data = bytearray(whole)
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(data)))
        kind = draw(st.sampled_from(["word", "cut", "byte", "end", "repeat"]))
        if kind == "word":
            data[at:at] = draw(st.sampled_from(WORDS))
        elif kind == "cut":
            del data[at : at + draw(st.integers(1, 40))]
        elif kind == "byte" and at < len(data):
            data[at] = draw(st.integers(0, 255))
        elif kind == "end":
            del data[at:]
        elif kind == "repeat":
            data += data[at : at + 200] * draw(st.integers(1, 20))
    return bytes(data)


@pytest.fixture(scope="module", autouse=True)
def cap():
    """End a reader that takes too long or asks for too much memory."""

    def late(_signal: int, _frame: object) -> None:
        raise TimeoutError(f"a reader took more than {MOST_S} s of processor time")

    before = signal.signal(signal.SIGPROF, late)
    limits = resource.getrlimit(resource.RLIMIT_AS)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MOST_BYTES, limits[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, limits)
    signal.signal(signal.SIGPROF, before)


def reads_or_refuses(read: Callable[[], object], where: str) -> None:
    """Require one of the two, within the cap."""
    signal.setitimer(signal.ITIMER_PROF, MOST_S)
    try:
        read()
    except InputError as error:
        said = str(error)
        assert "\n" not in said
        assert len(said) < 20_000
        assert where in said
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)


# Of a failing file of that size, Hypothesis says first that it is too long to print: the error matters more.
@pytest.mark.filterwarnings("ignore:Generating overly large repr")
@pytest.mark.parametrize("kind", READERS)
def test_a_reader_survives_any_file(kind, tmp_path):
    pytest.importorskip("pyarrow")
    name, whole, read = READERS[kind]
    if name == "dataset.toml":
        (tmp_path / "a.csv").write_bytes(LOG)

    @settings(max_examples=180 * TIMES, suppress_health_check=list(HealthCheck))
    @given(mangled(whole))
    def attempt(data: bytes) -> None:
        (tmp_path / name).write_bytes(data)
        with np.errstate(all="ignore"):
            reads_or_refuses(lambda: read(tmp_path / name), str(tmp_path))

    attempt()


@settings(max_examples=200 * TIMES)
@given(st.text(alphabet=string.ascii_letters + string.digits + "+-*/(),. _^[]", max_size=60))
def test_a_formula_is_compiled_or_refused(text):
    reads_or_refuses(lambda: compile_formula(text), "")


@pytest.mark.parametrize(
    "text", ["(" * 200 + ")" * 200, "speed" + ".a" * 190, "-" * 399 + "1", "9" * 399, "2**" * 100]
)
def test_a_formula_of_depth_is_refused(text):
    with pytest.raises(InputError):
        compile_formula(text)
