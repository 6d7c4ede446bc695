"""The console command: one name for all programs, one JSON object for machines."""

import json
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from mecanum_cli import doctor as doctor_module
from mecanum_cli.__main__ import main
from mecanum_cli.doctor import Check
from mecanum_cli.machine import run_for_machines
from mecanum_cli.table import COMMANDS, load, overview
from mecanum_env.effects import CATALOGUE
from mecanum_env.errors import InputError
from mecanum_env.files import asset_path
from mecanum_env.samples import SAMPLES, with_samples


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_command_exists_and_says_what_it_does(name):
    assert load(name)
    (line,) = (line for line in overview().splitlines() if line.split()[0] == name)
    assert line.split(maxsplit=1)[1].endswith(".")


def test_the_overview_imports_no_program():
    code = "import sys; from mecanum_cli.__main__ import main; main(['--help']); print(sorted(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    modules = done.stdout.splitlines()[-1]
    for heavy in ("'mujoco'", "'numpy'", "'sysid.fit.__main__'", "'training.train.__main__'"):
        assert heavy not in modules


def test_an_unknown_command_is_refused_with_the_nearest(capsys):
    assert main(["fitt"]) == 2
    assert capsys.readouterr().err == (
        "error: no command 'fitt' (did you mean \"fit\"?); `mecanum --help` lists all\n"
    )
    assert main([]) == 2


def test_a_command_of_two_words_has_its_name_in_its_help(capsys):
    with pytest.raises(SystemExit):
        main(["logs", "check", "--help"])
    assert "usage: mecanum logs check" in capsys.readouterr().out
    assert main(["logs"]) == 2
    assert "usage: mecanum logs {" in capsys.readouterr().err


def answer(capsys, *args: str) -> tuple[int, dict]:
    code = main([*args, "--json"])
    return code, json.loads(capsys.readouterr().out)


def test_json_has_what_was_found_and_printed(capsys):
    code, said = answer(capsys, "logs", "check", "@examples/logs")
    assert (code, said["exit_code"], said["error"]) == (0, 0, None)
    assert said["command"] == ["logs", "check"]
    assert said["found"]["level"] == "bench"
    assert len(said["found"]["runs"]) == 27
    assert said["text"].startswith(said["found"]["name"])


def test_json_has_the_files_and_what_is_in_them(capsys, tmp_path):
    code, said = answer(capsys, "logs", "plot", "@examples/logs", "--out", str(tmp_path / "logs.png"))
    assert (code, said["wrote"], said["results"]) == (0, [str(tmp_path / "logs.png")], {})
    code, said = answer(capsys, "online", "@examples/gap_logs", "--out", str(tmp_path))
    assert (code, list(said["results"])) == (0, ["online.json"])
    assert said["results"]["online.json"] == json.loads((tmp_path / "online.json").read_text())


def test_json_has_the_error(capsys, tmp_path):
    code, said = answer(capsys, "fit", str(tmp_path / "none"))
    assert (code, said["exit_code"], said["wrote"]) == (2, 2, [])
    assert "no such file or folder" in said["error"]
    code, said = answer(capsys, "fit", "--nonsense")
    assert code == 2
    assert "see stderr" in said["error"]


def programs() -> dict[str, Callable[..., Any]]:
    """Return every program by its words."""
    found = {}
    for name in COMMANDS:
        one = load(name)
        parts = one if isinstance(one, Mapping) else {"": one}
        found |= {f"{name} {word}".strip(): each for word, each in parts.items()}
    return found


def test_every_program_says_what_it_wrote_and_found():
    ends = {name: program.__annotations__["return"] for name, program in programs().items()}
    assert {name for name, end in ends.items() if end != "Done"} == {"simulated-robot"}  # never ends


def test_json_has_the_catalogue_of_effects(capsys):
    code, said = answer(capsys, "effects")
    assert (code, said["found"].keys()) == (0, CATALOGUE.keys())
    latency = said["found"]["command_latency"]["parameters"]["delay_s"]
    assert (latency["unit"], latency["neutral"]) == ("s", 0.0)


def test_json_has_a_plan(capsys, tmp_path):
    code, said = answer(capsys, "logs", "plan", "--minutes", "12", "--out", str(tmp_path / "plan"))
    assert (code, said["wrote"]) == (0, [str(tmp_path / "plan" / "PROTOCOL.md")])
    assert said["found"]["runs"]
    assert 0.0 < said["found"]["minutes"] <= 12.0


def test_json_has_a_script_of_completion(capsys):
    code, said = answer(capsys, "completion", "bash")
    assert (code, said["error"]) == (0, None)
    assert "complete" in said["text"]


def test_json_has_the_sentence_of_a_fault(capsys, tmp_path, monkeypatch):
    def divide() -> None:
        """Fail."""
        raise ZeroDivisionError("division by zero")

    monkeypatch.chdir(tmp_path)
    assert run_for_machines(divide, [], "mecanum divide") == 3
    said = json.loads(capsys.readouterr().out)
    assert said["error"] == "ZeroDivisionError: division by zero; a fault of the program, please report it"


def test_packaged_inputs_have_names():
    assert with_samples(["a", *SAMPLES]) == ["a", *(str(asset_path(name[1:])) for name in SAMPLES)]
    for wrong in ("@examples/log", "@", "@../etc", "@/etc/passwd"):
        with pytest.raises(InputError, match=r"no packaged file or folder.*@examples/logs"):
            with_samples([wrong])


def test_the_doctor_says_3_and_what_to_do(capsys, monkeypatch):
    fine, broken = Check("plugin", True, "here"), Check("renderer", False, "no library", "apt-get install it")
    monkeypatch.setattr(doctor_module, "_by_running", lambda *_: fine)
    monkeypatch.setattr(doctor_module, "_renderer", lambda: fine)
    assert main(["doctor"]) == 0
    monkeypatch.setattr(doctor_module, "_renderer", lambda: broken)
    assert main(["doctor"]) == 3
    assert "MISSING renderer: no library\n        apt-get install it\n" in capsys.readouterr().out


def test_the_doctor_survives_a_program_that_dies():
    check = doctor_module._by_running("renderer", "import os; os.abort()", "do this")
    assert (check.passed, check.found, check.advice) == (False, "ended with code -6", "do this")


def test_the_plugin_of_this_machine_is_fine():
    check = doctor_module._by_running("plugin", doctor_module._PLUGIN, "")
    assert check.passed, check.found
    assert Path(check.found).name.startswith("mecanum_wheel-mujoco-")


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["f"], "fit"),
        (["logs", "ch"], "check"),
        (["fit", "--sta"], "--starts"),
        (["train", "--algo", "p"], "ppo"),
    ],
)
def test_bash_completes_commands_and_options(words, wanted, tmp_path):
    script = subprocess.run(
        [sys.executable, "-m", "mecanum_cli", "completion", "bash"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    (tmp_path / "completion").write_text(script)
    line = ["mecanum", *words]
    program = (
        f"source {tmp_path / 'completion'}; COMP_WORDS=({' '.join(line)}); COMP_CWORD={len(words)}; "
        '_tyro_mecanum; printf "%s\\n" "${COMPREPLY[@]}"'
    )
    done = subprocess.run(["bash", "-c", program], capture_output=True, text=True, check=True)
    assert wanted in done.stdout.split()
