"""Gymnasium environments of the walking hexapod, one by one and as vectors whose loop is in C.

`import hexapod_cosim.extensions.gym.envs` registers them. Imports models, controller and cosim.
"""
