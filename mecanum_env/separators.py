"""Tables with ';' or tabs between cells and decimal commas, as plain CSV text."""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path
from typing import Final

from mecanum_env.errors import InputError

_OTHERS: Final = (";", "\t")
_COMMA_NUMBER: Final = re.compile(r"\s*[+-]?\d*,\d+(?:[eE][+-]?\d+)?\s*")


def with_plain_separators(path: Path, text: str) -> str:
    """Return the text of a table with ',' between cells and '.' as the decimal point.

    The header says which separator the file has: ';' or tabs if it has no comma. Then a comma inside a number
    is a decimal one. Lines stay where they are; text that is plain already is returned unchanged.

    Args:
        path: the file, for messages.
        text: its text, lines ending in newlines.

    Raises:
        InputError: the file has numbers with a point and numbers with a comma.
    """
    header = text.partition("\n")[0]
    separator = next((one for one in _OTHERS if one in header and "," not in header), None)
    if separator is None:
        return text
    point: int | None = None
    comma: int | None = None
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    reader = csv.reader(io.StringIO(text), delimiter=separator)
    try:
        for cells in reader:
            plain = [c.replace(",", ".") if "," in c and _COMMA_NUMBER.fullmatch(c) else c for c in cells]
            if plain != cells:
                comma = comma or reader.line_num
            elif reader.line_num > 1 and any("." in cell for cell in cells):
                point = point or reader.line_num
            writer.writerow(plain)
    except csv.Error as error:
        raise InputError(f"{path}, line {reader.line_num}: not CSV ({error})") from error
    if point and comma:
        raise InputError(
            f"{path}: line {point} has a number with a decimal point and line {comma} one with a comma; "
            "write all of them alike"
        )
    return out.getvalue()
