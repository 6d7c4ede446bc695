"""Tasks for workers, as expressions: any worker can evaluate them, wherever the tests lie."""

from collections.abc import Callable
from pathlib import Path

import pytest

from mecanum_env.parallel import Task

KILL = "__import__('os').kill(__import__('os').getpid(), 9)"


@pytest.fixture
def task() -> Callable[[str, str], Task]:
    """Return a function that makes the task with a name that evaluates an expression."""
    return lambda name, expression: Task(name, eval, (expression,))


@pytest.fixture
def killed_once(tmp_path: Path) -> str:
    """Return an expression that kills its process the first time and is 7 the second time."""
    begun = tmp_path / "begun"
    return f"{KILL} if not __import__('os').path.exists({str(begun)!r}) and open({str(begun)!r}, 'x') else 7"
