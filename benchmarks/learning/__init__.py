"""Environment steps per second, beside mujoco.rollout and fmugym."""
