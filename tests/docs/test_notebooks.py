"""The notebooks run from the first cell to the last, as a reader opens them."""

from pathlib import Path

import pytest

from tests.docs.blocks import ROOT

FOLDER = ROOT / "examples" / "notebooks"


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.ipynb")), ids=lambda path: path.stem)
@pytest.mark.filterwarnings("ignore")
def test_a_notebook_runs(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nbformat = pytest.importorskip("nbformat", reason="the docs extra is not installed")
    nbclient = pytest.importorskip("nbclient", reason="the docs extra is not installed")
    pytest.importorskip("ipykernel", reason="the docs extra is not installed")
    if path.stem == "train_and_certify":
        pytest.importorskip("stable_baselines3", reason="the train extra is not installed")
    monkeypatch.setenv("MPLBACKEND", "Agg")
    notebook = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(
        notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(FOLDER)}}
    ).execute()


def test_notebooks_are_kept_without_output() -> None:
    assert [path.name for path in FOLDER.glob("*.ipynb") if '"output_type"' in path.read_text("utf-8")] == []
