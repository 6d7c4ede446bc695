"""Design of experiments: the command sequence that would settle what the logs leave open."""
