"""Videos of a controller at work: `python -m training.record`; `rollout` draws one episode as frames."""
