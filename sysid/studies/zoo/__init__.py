"""Drives and robots drawn at random, with hidden effects: the yardstick of the gap workflow."""
