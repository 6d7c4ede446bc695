"""Two controllers against each other: `python -m training.duel A B`, and self-play: `training.duel.league`.

match        many bouts of two controllers, side by side, and their result
film         pictures of one bout
elo          ratings of many players from the results between them
environment  bouts against frozen players, as Stable-Baselines3 sees them
league       self-play: a learner against its past selves
"""
