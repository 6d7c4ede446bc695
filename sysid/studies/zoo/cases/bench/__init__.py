"""Cases of one wheel on the bench: what can be hidden in a drive, the commands of its logs, and the draw."""
