"""The notebooks run from the first cell to the last, as a reader opens them.

One does so in a kernel of its own. Of the others only the cells are tried: here, among few effects as the
pages, since a kernel would import everything again and compute what `tests/gap/test_example.py` has computed.
"""

from pathlib import Path
from typing import Any

import pytest

from tests.docs.blocks import ROOT

FOLDER = ROOT / "examples" / "notebooks"
IN_A_KERNEL = FOLDER / "paper.ipynb"
OTHERS = sorted({*FOLDER.glob("*.ipynb")} - {IN_A_KERNEL})


def notebook_of(path: Path) -> Any:
    """Return a notebook, read as a kernel's client does; skip what the installation has no extras for."""
    nbformat = pytest.importorskip("nbformat", reason="the docs extra is not installed")
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    return notebook


@pytest.mark.filterwarnings("ignore")
def test_a_notebook_runs_in_a_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    nbclient = pytest.importorskip("nbclient", reason="the docs extra is not installed")
    pytest.importorskip("ipykernel", reason="the docs extra is not installed")
    monkeypatch.setenv("MPLBACKEND", "Agg")
    nbclient.NotebookClient(
        notebook_of(IN_A_KERNEL),
        timeout=300,
        kernel_name="python3",
        resources={"metadata": {"path": str(FOLDER)}},
    ).execute()


@pytest.mark.parametrize("path", OTHERS, ids=lambda path: path.stem)
@pytest.mark.filterwarnings("ignore")
def test_the_cells_of_a_notebook_run_in_their_order(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if path.stem == "train_and_certify":
        pytest.importorskip("stable_baselines3", reason="the train extra is not installed")
    plt = pytest.importorskip("matplotlib.pyplot")
    plt.switch_backend("Agg")
    notebook = notebook_of(path)
    assert notebook.metadata.kernelspec.name == notebook_of(IN_A_KERNEL).metadata.kernelspec.name
    monkeypatch.chdir(FOLDER)
    names: dict[str, Any] = {"__name__": "__main__"}
    for number, cell in enumerate(notebook.cells):
        if cell.cell_type == "code":
            exec(compile(cell.source, f"{path.name}:{number}", "exec"), names)
    plt.close("all")


def test_notebooks_are_kept_without_output() -> None:
    assert [path.name for path in FOLDER.glob("*.ipynb") if '"output_type"' in path.read_text("utf-8")] == []
