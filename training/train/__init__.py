"""Training policies with Stable-Baselines3: `python -m training.train`; needs the `train` extra.

settings      the settings of a run
environments  the environments as the learner sees them
agent         PPO or SAC, and its export to a network that needs NumPy alone
run           training, and resuming after an interruption
checkpoint    the files of a training folder
card          measured success of a policy, as a page
curve         learning curves, as a picture
"""
