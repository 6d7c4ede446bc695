"""Predictions: the robot's own motion, the present behind late observations, the opponent's strike."""
