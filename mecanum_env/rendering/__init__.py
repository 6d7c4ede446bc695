"""Offline pictures and videos of simulated drives.

mujoco chooses its graphics library when it is imported, so a program that draws first calls
`backend.use_backend` and then imports `video`. This package, `backend` and `view` do not import mujoco.
"""
