"""Logs of other programs, in and out: tables, MCAP with JSON messages, LeRobot datasets."""
