.PHONY: bench-gym
help-extensions::
	@echo "make bench-gym  environment steps a second of the learning environments and of mujoco.rollout (1 min)"

bench-gym: setup
	$(BIN)/python -m benchmarks.gym
