"""What a study of one recording is given by the fit of law and effects."""

from __future__ import annotations

import pytest

from mecanum_env.model import paper_model
from sysid.gap import alone
from sysid.gap.result import GapOptions
from sysid.logs import Dataset


def test_the_law_is_studied_and_the_whole_model_tells_when_commands_acted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    whole = paper_model().with_effect("command_latency", "jitter", delay_s=0.1, jitter_s=0.02)
    whole = whole.with_effect("coulomb_friction", torque_n_m=0.4).with_effect("speed_gain", gain=0.9)
    monkeypatch.setattr(alone, "_selected", lambda dataset: dataset)
    monkeypatch.setattr(alone, "fit_dataset", lambda *_: None)
    monkeypatch.setattr(alone, "fitted_model", lambda _: whole)
    law, options = alone.law_of(Dataset("made", (), ()), GapOptions())
    assert list(law.effects) == ["command_latency/jitter"]
    assert options.timed_by is whole
    assert any("coulomb_friction + speed_gain" in note for note in options.notes)
