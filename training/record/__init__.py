"""Videos of a controller at work: `python -m training.record`.

rollout  one episode as frames
strip    plots of commanded against actual speed, under the picture
"""
