"""The benchmark's folder: cases, truths, the scorer, an example and a page, for use without this package."""

from __future__ import annotations

import datetime
import json
import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

import mecanum_env
from mecanum_env.checkout import commit
from mecanum_env.errors import BackendError, InputError, install_command
from mecanum_env.files import atomic_path, write_json, write_text
from mecanum_env.outputs import finish_interrupted, output_folder
from mecanum_env.parallel import Task, Workers, run_tasks
from sysid.fit import fit_dataset, fitted_model
from sysid.logs import read_dataset
from sysid.studies import score
from sysid.studies.gapbench.case_folder import Material, columns, write_case
from sysid.studies.gapbench.names import names_json, names_table
from sysid.studies.gapbench.real import real_cases
from sysid.studies.gapbench.simulated import simulated_case
from sysid.studies.zoo.seeds import spans

FOLDER: Final = Path(__file__).parent / "folder"
"""What a benchmark's folder is made of."""
_VERBATIM: Final = ("truth.schema.json", "answers.schema.json", "example_adapter.py")
"""Files of it that are copied as they are."""
MANIFEST: Final = "gapbench.json"
COMMAND: Final = "sysid.studies.gapbench make"
"""Name of what writes the folder."""


def make_bench(
    out: Path,
    seeds: Sequence[int],
    recordings: Iterable[Path] = (),
    *,
    sealed: bool = False,
    parquet: bool = False,
    jobs: int = 1,
) -> tuple[str, ...]:
    """Write a benchmark's folder and return the cases that could not be made, each with its error.

    Args:
        out: folder to write; cases that it has already are left as they are.
        seeds: of the simulated cases.
        recordings: folders of recordings of real machines.
        sealed: whether these seeds are spent on this benchmark.
        parquet: whether every case is also written as Parquet tables.
        jobs: number of worker processes; the result does not depend on it.

    Raises:
        InputError: recordings that cannot be used, Parquet without its library, or a folder that holds other
            cases.
    """
    manifest = _manifest(seeds, sealed)
    finish_interrupted(out)
    _require_same(out, manifest)
    # Before the cases, so that a run with other seeds is refused even if this one does not come to its end.
    with output_folder(out, COMMAND, shared=True) as staged:
        write_fixtures(staged)
        write_json(staged / MANIFEST, manifest)
    todo = [(s, n) for s, n in ((s, f"case_{i:03d}") for i, s in enumerate(seeds)) if not _is_made(out, n)]
    tasks = [Task(name, _make, (seed, name, out)) for seed, name in todo]
    errors: list[str] = run_tasks(tasks, Workers(jobs=jobs))
    failed = [error for error in errors if error]
    for folder in recordings:
        for material in real_cases(folder):
            if not _is_made(out, material.name):
                failed += filter(None, [_written(material, out)])
    if parquet:
        with output_folder(out, COMMAND, shared=True) as staged:
            for case in sorted((out / "cases").iterdir()):
                write_parquet(case, staged / "parquet" / case.name)
    return tuple(failed)


def write_fixtures(out: Path) -> None:
    """Write to a benchmark's folder, `out`, what all have: page, names, schemas, scorer, example."""
    for name in _VERBATIM:
        shutil.copyfile(FOLDER / name, out / name)
    shutil.copyfile(score.__file__, out / "score.py")
    write_json(out / "names.json", names_json())
    write_text(out / "README.md", _readme())


def _make(seed: int, name: str, out: Path) -> str:
    """Make the simulated case of a seed; return an error in words, empty if there was none."""
    try:
        return _written(simulated_case(seed, name), out)
    except RuntimeError as error:
        return f"{name} (seed {seed}): {error}"


def _written(material: Material, out: Path) -> str:
    """Write a case; return an error in words, empty if there was none."""
    try:
        model = fitted_model(fit_dataset(material.nominal))
        # Other processes write other cases meanwhile.
        with output_folder(out, COMMAND, shared=True) as staged:
            write_case(material, model, staged)
    except (InputError, BackendError) as error:
        return f"{material.name}: {error}"
    return ""


def _is_made(out: Path, name: str) -> bool:
    return (out / "truth" / name / "truth.json").is_file()


def _manifest(seeds: Sequence[int], sealed: bool) -> dict[str, Any]:
    return {
        "format": "gapbench/1",
        "version": mecanum_env.__version__,
        "commit": commit() or "unknown",
        "date": datetime.date.today().isoformat(),
        "seeds": spans(seeds),
        "sealed": sealed,
    }


def _require_same(out: Path, manifest: dict[str, Any]) -> None:
    """Refuse to mix cases of other seeds into a folder."""
    path = out / MANIFEST
    if path.is_file():
        there = json.loads(path.read_text(encoding="utf-8"))["seeds"]
        if there != manifest["seeds"]:
            raise InputError(
                f"{out}: has the cases of seeds {there}, not {manifest['seeds']}; choose another --out"
            )


def _readme() -> str:
    words = "\n".join(f"- **{word}**: {meaning}." for word, meaning in score.WORDS.items())
    sizes = ", ".join(f"{size} below {end:g}" for size, (_, end) in list(score.SIZES.items())[:-1])
    text = (FOLDER / "README.md").read_text(encoding="utf-8")
    parts = {"@WORDS@": words, "@SIZES@": f"{sizes}, gross above", "@NAMES@": names_table()}
    for mark, part in parts.items():
        text = text.replace(mark, part)
    return text


def write_parquet(case: Path, target: Path) -> None:
    """Write the logs of a case to a `target` folder: one Parquet table per part, with file and split."""
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ModuleNotFoundError as error:
        raise InputError(f"Parquet needs pyarrow: {install_command('parquet')}") from error
    for part in ("nominal", "changed"):
        tables = []
        for run in read_dataset(case / part).runs:
            said = np.genfromtxt(
                case / "simulator" / part / run.file, delimiter=",", names=True, dtype=float
            )["speed_rpm"]
            about = {key: [getattr(run, key)] * run.time_s.size for key in ("file", "group", "split")}
            tables.append(pa.table({**about, **columns(run), "simulated_rpm": said}))
        with atomic_path(target / f"{part}.parquet") as path:
            pq.write_table(pa.concat_tables(tables, promote_options="default"), path)
