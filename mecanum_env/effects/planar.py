"""The body of the robot that slides without slip, as numbers: what effects change of it without MuJoCo."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PlanarBody:
    """Mass, damping and gravity of the planar plant (`mecanum_env.mjcf.planar_spec`), wheels not included."""

    mass_kg: float
    """Mass of the base."""
    yaw_inertia_kg_m2: float
    """Its moment about its centre of mass."""
    com_x_m: float = 0.0
    com_y_m: float = 0.0
    """Its centre of mass, ahead of the middle of the wheels and to the left."""
    middle_mass_kg: float = 0.0
    """Further mass in the middle of the wheels."""
    middle_yaw_inertia_kg_m2: float = 0.0
    wheel_damping_n_m_s_rad: float = 0.0
    """Viscous friction of each wheel."""
    gravity_m_s2: tuple[float, float, float] = (0.0, 0.0, -9.81)
    """Gravity in the world's axes, MuJoCo's own on a level floor."""
