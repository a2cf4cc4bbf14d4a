"""Changes a scenario, runs it and prints its metrics.

usage: python examples/02_walk.py
"""

from hexapod_cosim.cosim.results.metric_table import METRICS
from hexapod_cosim.cosim.run import simulate
from hexapod_cosim.cosim.scenario.reading import load_scenario


def main() -> None:
    """Walks three gait cycles on smooth rubber and prints the metrics."""
    scenario = load_scenario(
        "walk_flat", overrides=["duration=3", "friction.mu=0.5", "command.vx=60 mm/s"]
    )
    result = simulate(scenario)
    position = result.outcome.recording.vector("torso.position")
    distance = position[-1, 0] - position[0, 0]
    print(f"{result.outcome.status}: {distance:.3f} m in {result.outcome.simulated:g} s")
    for name, value in result.metrics.items():
        print(f"{name:20} {value:10.4g} {METRICS[name][0]}")


if __name__ == "__main__":
    main()
