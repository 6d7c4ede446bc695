"""The order of the results: what each chapter says, shows and tabulates, for the page and Markdown alike."""

from __future__ import annotations

from dataclasses import dataclass

from sysid.reproduce import tables
from sysid.reproduce.experiment import Reproduction
from sysid.reproduce.tables import Table, comparison_table


@dataclass(frozen=True)
class Chapter:
    """One part of the results."""

    title: str
    text: str
    charts: tuple[str, ...]
    """Names in `charts`."""
    tables: tuple[Table, ...]


def chapters(found: Reproduction) -> list[Chapter]:
    """Return the results in the order of the paper."""
    return [
        Chapter(
            "Success and stability from random starts (section 4.1)",
            "Every gradient method descends from the same random starts. The paper reports 10; more tell "
            "how sure that is. The curves show all thresholds at once: how large a share of the starts "
            "ends with an rms at or below each value.",
            ("starts",),
            (
                tables.starts_table(found),
                tables.fates_table(found),
                comparison_table(found, "starts"),
                tables.law_table(found),
            ),
        ),
        Chapter(
            "Step responses (Fig. 3) and their figures (Fig. 4)",
            "The test steps took no part in any fit.",
            ("fig3-steps", "fig4-metrics"),
            (
                tables.metric_table(found),
                comparison_table(found, "metrics"),
                tables.speed_table(found),
                tables.error_table(found),
            ),
        ),
        Chapter(
            "Beyond the linear range (Fig. 5)",
            "No linear law knows a ceiling. Limiting its command adds one; output error can estimate it too.",
            ("fig5-beyond",),
            (comparison_table(found, "beyond"),),
        ),
        Chapter(
            "Random inputs (Table 1, Fig. 6)",
            "Five trials of 5.2 s: five holds longer than the drive settles and five shorter, in random "
            "order.",
            ("fig6-random",),
            (tables.trial_table(found), comparison_table(found, "trials")),
        ),
        Chapter(
            "Time and memory (Table 2)",
            "",
            (),
            (tables.cost_table(found), comparison_table(found, "cost")),
        ),
        Chapter(
            "The robot (Fig. 7)",
            "The wheel that output error identified, four times, under the robot on its rollers in MuJoCo: "
            "rest, 3 s of the command, stop. The paper measured a real robot; its losses are effects that "
            "a free wheel does not have, so a simulation without them must lose less.",
            ("fig7-robot",),
            (tables.robot_table(found), comparison_table(found, "robot")),
        ),
    ]
