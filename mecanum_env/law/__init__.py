"""The wheel law: a third-order difference equation from commanded to actual wheel speed."""

from mecanum_env.law.coefficients import LawState, WheelLaw

__all__ = ["LawState", "WheelLaw"]
