"""Controllers for the Mecanum robot: pose in, whole V, theta, VC out, ten times a second."""
