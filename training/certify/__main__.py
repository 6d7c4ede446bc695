"""Certify a controller: `python -m training.certify CONTROLLER --model model.json`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final, Literal

import tyro

from mecanum_env.cli import run
from mecanum_env.errors import InputError
from mecanum_env.parallel import Workers
from mecanum_env.programs import Done
from training.certify.thresholds import Thresholds

_ALL: Final = "all"
_FILES: Final = ("certificate.json", "certificate.html")


def main(
    controller: tyro.conf.Positional[str],
    /,
    model: Path | None = None,
    episodes: int = 200,
    plants: tuple[str, ...] = (_ALL,),
    out: Path = Path("certificate"),
    physics: Literal["planar", "rollers"] = "planar",
    difficulty: str = "normal",
    workers: tyro.conf.OmitArgPrefixes[Workers] = Workers(),
    thresholds: Thresholds = Thresholds(),
    bound: bool = True,
) -> Done:
    """Play a controller on many plants; write its metrics and whether they meet the thresholds.

    Writes certificate.json and certificate.html. Exit code 0: passed; 1: not passed; 2: bad input; 3:
    the machine failed.

    Example: python -m training.certify retreat --model gap/model.json --plants nominal robot-level latency

    Args:
        controller: Name of a controller (random, still, p, smith, lqr, retreat, sidestep, creep, mpc, oracle)
            or of a bundled policy (nominal, planned, predicting, robust, timing, varied; policy is
            predicting), or the file or folder of a trained one; followed by +compensated: with the model's
            effects compensated.
        model: Model file of the robot; by default the packaged one.
        episodes: Number of episodes per plant, with the seeds 0, 1, ...
        plants: Plants or groups of plants (nominal, effects, posterior, robot-level, latency, what-if,
            opponents, senses, adversary, held-out), or all; docs/certify.md lists them. The nominal plant and
            those held out are always played.
        out: Folder to write.
        physics: planar, which is fast, or rollers: every roller on the floor, on all plants.
        difficulty: Difficulty of the opponent: easy, normal or hard.
        workers: Where the episodes are played.
        thresholds: What a controller must reach; compared with the worse end of the metric's interval.
        bound: Also play the oracle, of whose success the table then gives the share.

    Returns:
        The exit code.
    """
    # Imported here, so that --help does not wait for the library.
    from tqdm import tqdm

    from mecanum_env.model import paper_model, read_model
    from mecanum_env.outputs import output_folder
    from training.certify.certificate import write_certificate
    from training.certify.plants import GROUPS
    from training.certify.report import certificate_table, write_certificate_page
    from training.certify.run import CertifyOptions, certify_controller, episodes_of, require_usable

    if not plants:
        raise InputError(f"--plants: none is given; name plants or groups ({', '.join(GROUPS)}), or {_ALL}")
    options = CertifyOptions(
        episodes=episodes,
        plants=() if _ALL in plants else plants,
        physics=physics,
        difficulty=difficulty,
        workers=workers,
        thresholds=thresholds,
        bound=bound,
    )
    require_usable(options)
    robot = paper_model() if model is None else read_model(model)
    files = output_folder(out, "training.certify", _FILES)
    with files as staged, tqdm(total=episodes_of(options, robot), unit="episode", disable=None) as bar:

        def progress(name: str, count: int) -> None:
            bar.set_description(name)
            bar.update(count)

        certificate = certify_controller(controller, robot, options, progress)
        write_certificate(certificate, staged / _FILES[0])
        write_certificate_page(certificate, staged / _FILES[1])
    written = [out / name for name in _FILES]
    print(f"{certificate_table(certificate)}\n\nwrote {', '.join(map(str, written))}")
    return Done(0 if certificate.passed else 1, wrote=written)


if __name__ == "__main__":
    sys.exit(run(main, prog="python -m training.certify"))
