"""The wheel law: a third-order difference equation from commanded to actual wheel speed.

coefficients  the law: A-F, its poles, its simulation
stability     which A, B and C are stable, and the nearest ones that are
conversion    the law for another sample period
metrics       rise, settling, overshoot and steady-state error of a step response
motor         the law of a DC motor under PID control, and the motor of a law
arrays        what numpy and torch have in common
"""

from mecanum_env.law.coefficients import LawState, WheelLaw

__all__ = ["LawState", "WheelLaw"]
