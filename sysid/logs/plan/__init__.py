"""A recording session for a user's own robot: commands to play, how often, and what to do with the logs."""
