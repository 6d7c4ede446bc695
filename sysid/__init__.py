"""System identification: from logs of a wheel or robot to a `model.json`, and the gap between the two."""
