"""Cases of a robot on the floor: what can be hidden in it, the commands of its logs, and the draw."""
