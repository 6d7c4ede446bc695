"""Offline pictures and videos of simulated drives.

mujoco picks its graphics library when it is imported, so a program that draws calls `backend.use_backend`
first and imports `video` after. This module and `backend`, `view`, `caption` import no mujoco.
"""
