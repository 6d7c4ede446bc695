"""What every command line program shares: arguments from a function's signature, errors and exit codes.

0: done; 1: a certificate says "not passed"; 2: bad input; 3: the machine failed, or the program itself. Every
error is one sentence on stderr. For 3 the traceback is saved beside the output.
"""

from __future__ import annotations

import errno
import inspect
import io
import os
import re
import select
import sys
import tempfile
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import tyro

from mecanum_env.errors import InputError, MachineError, MecanumError, is_machine_error
from mecanum_env.samples import with_samples

_LONGEST: Final = 2000
"""Longest sentence that is printed in full [characters]."""
_OF_A_PATH: Final = frozenset(
    (errno.ENOENT, errno.EACCES, errno.EPERM, errno.ENOTDIR, errno.EISDIR, errno.ELOOP, errno.ENAMETOOLONG)
)
"""Errors of the operating system that another path mends."""
_MACHINE: Final = MachineError.exit_code
_BAD_INPUT: Final = InputError.exit_code


def run(command: Callable[..., Any], args: Sequence[str] | None = None, prog: str | None = None) -> int:
    """Call a command with parsed arguments and return the exit code of the program.

    Args:
        command: its signature gives the options, its docstring the help.
        args: the arguments; those of the running program when None. ``@examples/logs`` is a packaged folder.
        prog: name of the program in the help; that of the running one when None.

    Returns:
        The integer that the command returned, such as 1 for a failed certificate, or 0 if it returned
        anything else; the `exit_code` of a `MecanumError` that it raised, whose message goes to stderr; 3 for
        any other error; 130 if it was interrupted. For wrong arguments tyro prints what is known and raises
        ``SystemExit(2)``.
    """
    given = sys.argv[1:] if args is None else args
    # File names may hold bytes that are no text.
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        args = with_samples(given)
        _require_no_empty(args)
        # tyro would break the help's lines where the docstring's end.
        command.__doc__ = _joined(inspect.getdoc(command) or "")
        try:
            result = tyro.cli(command, args=args, prog=prog)
        finally:
            # Here, since `--help | head` would else fail at the interpreter's end.
            sys.stdout.flush()
    except KeyboardInterrupt:
        print("interrupted; nothing half-written was left behind", file=sys.stderr)
        return 130
    except Exception as error:
        if isinstance(error, BrokenPipeError) and _reader_has_gone():
            return 0
        code, sentence = judged(error)
        if code == _MACHINE:
            sentence += _kept(error, _place(command, given))
        # Notes say in which of many tasks it was; that of a fault is a traceback.
        notes = getattr(error, "__notes__", ()) if isinstance(error, MecanumError) else ()
        print("\n  ".join([f"error: {sentence}", *notes]), file=sys.stderr)
        return code
    return result if isinstance(result, int) else 0


def judged(error: Exception) -> tuple[int, str]:
    """Return the exit code of a program that ends with an `error`, and the sentence that says what it is."""
    if isinstance(error, MecanumError):
        text = str(error)
        if len(text) > _LONGEST:
            text = f"{text[: _LONGEST // 2]} ... {text[-_LONGEST // 2 :]}"
        return error.exit_code, text
    if is_machine_error(error):
        why = error.strerror if isinstance(error, OSError) else "out of memory"
        return _MACHINE, f"the machine failed: {why}; make room, or do less at a time"
    if isinstance(error, OSError) and error.errno in _OF_A_PATH and error.filename is not None:
        return _BAD_INPUT, f"{error.filename}: cannot be used ({error.strerror})"
    said = " ".join(str(error).split())[: _LONGEST // 2]
    what = f"{type(error).__name__}: {said}" if said else type(error).__name__
    return _MACHINE, f"{what}; a fault of the program, please report it"


def _joined(doc: str) -> str:
    """Return a docstring with each argument's description in a line of its own."""
    text, section, arguments = doc.partition("\nArgs:\n")
    return text + section + re.sub(r"\n {8,}(?=\S)", " ", arguments)


def _reader_has_gone() -> bool:
    """Return whether the reader of stdout (`| head`) has closed the pipe; nothing is printed from then on."""
    try:
        place = sys.stdout.fileno()
    except (OSError, ValueError):
        return False
    # Unbuffered, nothing may be left that would fail when it is flushed.
    pipe = select.poll()
    pipe.register(place, select.POLLOUT)
    has_gone = any(event & (select.POLLERR | select.POLLHUP) for _, event in pipe.poll(0))
    if has_gone:
        # Otherwise the interpreter fails again when it flushes.
        os.dup2(os.open(os.devnull, os.O_WRONLY), place)
    return has_gone


def _place(command: Callable[..., Any], args: Sequence[str]) -> Path:
    """Return the path beside which the traceback of a failed command belongs: that of its output."""
    for i, word in enumerate(args):
        name, _, value = word.partition("=")
        if name in ("--out", "--resume"):
            return Path(value or next(iter(args[i + 1 :]), "."))
    own = inspect.signature(command).parameters.get("out")
    return own.default if own is not None and isinstance(own.default, Path) else Path(command.__name__)


def _kept(error: Exception, place: Path) -> str:
    """Save the traceback of an error beside the output, or else where temporary files are; say where."""
    text = "".join(traceback.format_exception(error))
    for folder in (Path(os.path.abspath(place)).parent, Path(tempfile.gettempdir())):
        path = folder / f"{Path(os.path.abspath(place)).name or 'mecanum'}.error.txt"
        try:
            path.write_text(text, encoding="utf-8", errors="backslashreplace")
        except (OSError, ValueError):
            continue
        return f" (traceback: {path})"
    return " (its traceback could not be saved either)"


def _require_no_empty(args: Sequence[str]) -> None:
    """Refuse empty arguments, as unset shell variables give: an empty path would mean the current folder."""
    for before, word in zip(("", *args), args, strict=False):
        option = before if before.startswith("--") else "an argument"
        if word.startswith("--") and word.endswith("=") and word.count("=") == 1:
            option, word = word[:-1], ""
        if not word:
            raise InputError(f"{option} is empty; give a value, or leave it out")
