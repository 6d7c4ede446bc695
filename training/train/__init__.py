"""Training policies with Stable-Baselines3: `python -m training.train`; needs the `train` extra.

settings     what a run is told
levels       the robots of `--randomize levels`
environment  the environments as the learner sees them: memory (`stack`), robots (`group`), normaliser
agent        PPO or SAC
run          training, and going on after an interruption
checkpoint   what a training folder holds
export       from the learner to a file that needs numpy alone
play         many episodes with a network
card         what a policy file should be known for
"""
