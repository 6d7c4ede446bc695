"""What the documents tell a reader to type works: commands and Python run, or say why they do not."""

import ast
from pathlib import Path
from typing import Any

import pytest

from tests.docs.blocks import NOT_RUN, PAGES, ROOT, Block, blocks, call, commands, unknown_options

ENDS = {"training.certify": (0, 1)}
"""Exit codes other than 0 that are no failure: a controller may miss its thresholds."""
BLOCKS = {page: list(blocks(page)) for page in PAGES}
RUNS = [page for page in PAGES if any(not block.not_run for block in BLOCKS[page])]


EPISODES = "3"
"""Instead of as many as a page asks for; with fewer everything is done as with more."""


def shorter(words: list[str]) -> list[str]:
    """Return a command with fewer episodes."""
    pairs = zip(["", *words], words, strict=False)
    return [EPISODES if before == "--episodes" else word for before, word in pairs]


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", RUNS, ids=name_of)
@pytest.mark.usefixtures("desk")
def test_the_blocks_of_a_page_run_in_their_order(page: Path) -> None:
    names: dict[str, Any] = {"__name__": "__main__"}
    for block in BLOCKS[page]:
        if block.not_run:
            continue
        place = f"{block.page}:{block.line}"
        if block.kind == "python":
            exec(compile(block.text, place, "exec"), names)
            continue
        for words in map(shorter, commands(block)):
            code, said = call(words)
            program = words[2] if words[1] == "-m" else words[1]
            assert code in ENDS.get(program, (0,)), f"{place}: {' '.join(words)}\n{said}"


@pytest.mark.parametrize("page", [page for page in PAGES if BLOCKS[page]], ids=name_of)
@pytest.mark.usefixtures("desk")
def test_every_command_has_the_options_that_a_page_gives_it(page: Path) -> None:
    for block in BLOCKS[page]:
        if block.kind == "python":
            ast.parse(block.text)
            continue
        for words in commands(block):
            assert unknown_options(words) == [], f"{block.page}:{block.line}: {' '.join(words)}"


def test_a_reason_stands_before_a_block_that_is_not_run() -> None:
    marks = {page: len(NOT_RUN.findall(page.read_text(encoding="utf-8"))) for page in PAGES}
    assert marks == {page: sum(bool(block.not_run) for block in BLOCKS[page]) for page in PAGES}


def test_the_tutorial_needs_no_checkout() -> None:
    words = [word for block in BLOCKS[ROOT / "docs/tutorial.md"] for one in commands(block) for word in one]
    # What the demo left in out/ of this checkout is what the tutorial writes there itself.
    needed = [word for word in words if (ROOT / word).exists() and not word.startswith("out/")]
    assert [*needed, *(word for word in words if word.endswith(".py"))] == []


def test_an_option_that_no_program_has_is_noticed() -> None:
    gone = Block(
        "page.md", 1, "shell", "python -m sysid.fit examples/logs --no-such-option 3 --out fit\n", ""
    )
    assert [unknown_options(words) for words in commands(gone)] == [["--no-such-option"]]
    word = Block("page.md", 1, "shell", "python -m sysid.logs plan --top-sped 135\n", "")
    assert [unknown_options(words) for words in commands(word)] == [["--top-sped"]]


def test_an_unknown_program_is_noticed() -> None:
    with pytest.raises(AssertionError, match="no known program"):
        list(commands(Block("page.md", 1, "shell", "mecanumm fit\n", "")))
