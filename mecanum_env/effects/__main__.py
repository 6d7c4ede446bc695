"""`python -m mecanum_env.effects`: print the catalogue of effects."""

from __future__ import annotations

from mecanum_env.cli import run
from mecanum_env.programs import Done


def main() -> Done:
    """Print the catalogue of effects as a table in Markdown.

    Example: python -m mecanum_env.effects
    """
    from mecanum_env.effects import catalogue_json, catalogue_table

    print(catalogue_table())
    return Done(found=catalogue_json())


if __name__ == "__main__":
    raise SystemExit(run(main, prog="python -m mecanum_env.effects"))
