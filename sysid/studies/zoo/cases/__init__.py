"""The cases of the zoo, drives in `bench` and robots in `robot`; `write` writes the logs of either."""
