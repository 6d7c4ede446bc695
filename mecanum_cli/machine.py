"""Running a program for a machine that reads one JSON object from stdout."""

from __future__ import annotations

import functools
import io
import json
import sys
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any, Final

from mecanum_env.cli import judged, run
from mecanum_env.files import plain_json
from mecanum_env.programs import Done

FORMAT: Final = "mecanum-run/1"


def run_for_machines(command: Callable[..., Any], args: Sequence[str], prog: str) -> int:
    """Run a command as `mecanum_env.cli.run` does, and print one JSON object instead of its output.

    The object has "format", "command" (of `prog`), "arguments" (the `args`), "exit_code", "error" (a
    sentence, or null), "wrote" (paths), "results" (name -> content of each of these files that is JSON),
    "found" (what is in no file, or null) and "text" (what the command printed, which also goes to stderr).

    Returns:
        The exit code.
    """
    ended: list[Any] = [None]
    errors: list[str] = []

    @functools.wraps(command)
    def kept(*given: Any, **options: Any) -> Any:
        try:
            ended[0] = command(*given, **options)
        except Exception as error:
            errors.append(judged(error)[1])
            raise
        return ended[0]

    text = _Both()
    try:
        with redirect_stdout(text):
            code = run(kept, args, prog)
    except SystemExit as stop:
        # tyro has said on stderr what is wrong with the arguments, or printed the help that was asked for.
        code = stop.code if isinstance(stop.code, int) else 0 if stop.code is None else 2
    if code and not errors and not isinstance(ended[0], int):
        errors.append("the arguments are wrong, or the program was stopped: see stderr")
    done = ended[0] if isinstance(ended[0], Done) else Done(code)
    results = {path.name: _content(path) for path in done.wrote if path.suffix == ".json"}
    answer = {
        **{"format": FORMAT, "command": prog.split()[1:], "arguments": list(args), "exit_code": int(code)},
        "error": errors[0] if errors else done.error,
        **{"wrote": [str(path) for path in done.wrote], "results": results},
        **{"found": plain_json(done.found), "text": text.getvalue()},
    }
    print(json.dumps(answer, allow_nan=False))
    return code


class _Both(io.StringIO):
    """Keeps what is printed and shows it on stderr, so that a person who waits sees something."""

    def write(self, text: str) -> int:
        sys.stderr.write(text)
        return super().write(text)


def _content(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))
