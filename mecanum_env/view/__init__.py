"""The live robot in a browser page: `python -m mecanum_env.view MODEL`."""
