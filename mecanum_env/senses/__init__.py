"""What the robot senses of the opponent and of itself, and the estimate of both that it acts on.

    readings    what cameras and odometry deliver, some of it late, noisy or missing; how well they do
    filters     Kalman filters of many positions with their velocities
    estimator   readings in, places and velocities out, for the simulator and for a robot

Nothing here knows a simulator: a robot's own program fills in `CameraFrame` and `OwnReading` and calls
`Estimator.update` ten times a second.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
