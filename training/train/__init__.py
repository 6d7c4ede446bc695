"""Training policies with Stable-Baselines3: `python -m training.train`; needs the `train` extra.

settings       the settings of a run
robots         late, slow and unknown robots to train on
vec_env        the native environments as Stable-Baselines3 sees them, and the memory of a policy
workers        the environments in several processes
environments   what a run trains in: robots, opponents, senses
privileged     what no sensor shows, for a critic or a teacher
actor_critic   the networks that PPO trains
agent          PPO or SAC, and its export to a network that needs NumPy alone
rollout        rollouts on the learner's device
taught         PPO that imitates a teacher first
run            training, and resuming after an interruption
score          success in development episodes
checkpoint     the files of a training folder
learner_files  networks and optimisers as plain arrays
imitation      the advice of the planner `mpc`, and a network that is fitted to it
mirror         left and right exchanged, in observations and actions
planned        a policy by imitation alone: `python -m training.train.planned`
card           measured success of a policy, as a page
curve          learning curves, as a picture
"""
