"""What the zoo says about the thresholds of a verdict: `python -m sysid.studies.zoo.calibrate OUT`."""

from __future__ import annotations

import datetime
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

from mecanum_env.cli import run
from mecanum_env.errors import InputError

if TYPE_CHECKING:
    from sysid.studies.zoo.calibration import Calibration


def main(out: tyro.conf.Positional[Path] = Path("out/zoo"), /) -> None:
    """Compute thresholds from the saved outcomes of the zoo's development seeds; write calibration.json.

    No threshold is changed: what is printed says where each stands.

    Example: python -m sysid.studies.zoo.calibrate out/zoo

    Args:
        out: Folder that a run of the zoo with this very code has written.
    """
    # Imported here, so that --help does not wait for the library.
    import mecanum_env
    from mecanum_env.checkout import commit
    from mecanum_env.files import plain_json, require_writable, write_json
    from sysid.studies.zoo.calibration import calibrate
    from sysid.studies.zoo.page import seeds_of
    from sysid.studies.zoo.seeds import DEVELOPMENT
    from sysid.studies.zoo.sources import fingerprint
    from sysid.studies.zoo.work import read_outcome

    code = fingerprint()
    saved = [read_outcome(path) for path in sorted((out / code / "cases").glob("*.json"))]
    outcomes = [outcome for outcome in saved if outcome.case.seed in DEVELOPMENT]
    if not outcomes:
        raise InputError(
            f"{out}: no outcome of a development seed by this code ({code}); run python -m sysid.studies.zoo "
            f"--out {out}"
        )
    target = out / "calibration.json"
    require_writable(target)
    found = {
        "both": calibrate(outcomes),
        **{
            level: calibrate([o for o in outcomes if o.case.level == level])
            for level in ("bench", "robot")
            if any(o.case.level == level for o in outcomes)
        },
    }
    about = {
        "format": "mecanum-zoo-calibration/1",
        "version": mecanum_env.__version__,
        "commit": commit(),
        "fingerprint": code,
        "date": datetime.date.today().isoformat(),
        "seeds": seeds_of(outcomes),
    }
    write_json(target, {**about, "levels": plain_json(found)})
    for level, calibration in found.items():
        print(f"{level}:\n{_text(calibration)}\n")
    print(f"wrote {target}")


def _text(calibration: Calibration) -> str:
    """Return a calibration in words: present value, place and what the cases say, then each family."""
    from sysid.gap.search.thresholds import THRESHOLDS
    from sysid.studies.zoo.calibration import MOST_FALSE_ALARMS, QUIET_SHARE

    noise, chance = calibration.above_noise, calibration.p_value
    proposed = "none does" if chance.value is None else f"{chance.value:.3g}"
    why = f" ({chance.why})" if chance.why else ""
    lines = [
        f"  above_noise = {THRESHOLDS.above_noise:g} ({_place('above_noise')}): laws leave at most "
        f"{noise.value:.3g} ({noise.low:.3g} to {noise.high:.3g}) in {100 * QUIET_SHARE:g} % of "
        f"{noise.count} quiet studies with repeats",
        f"  false_alarm = {THRESHOLDS.false_alarm:g} ({_place('false_alarm')}): for at most "
        f"{100 * MOST_FALSE_ALARMS:g} % of false alarms {proposed}{why}; "
        f"false alarms {chance.alarms.text()}; clear and gross cases still found {chance.kept.text()}",
    ]
    for left in calibration.families:
        p_value = "none" if left.p_value is None else f"{left.p_value:.3g}"
        lines.append(
            f"    without {left.family}: above_noise {left.above_noise:.3g}, false_alarm {p_value}; on it "
            f"{left.above.text()} are above, false alarms {left.alarms.text()}"
        )
    return "\n".join(lines)


def _place(name: str) -> str:
    """Return file and line where a threshold stands."""
    from sysid.gap.search import thresholds

    path = Path(thresholds.__file__)
    lines = path.read_text(encoding="utf-8").splitlines()
    number = next(i for i, line in enumerate(lines, 1) if line.strip().startswith(f"{name}:"))
    return f"{'/'.join(path.parts[-4:])}, line {number}"


if __name__ == "__main__":
    sys.exit(run(main, prog="python -m sysid.studies.zoo.calibrate"))
