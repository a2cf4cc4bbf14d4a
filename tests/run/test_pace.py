"""Walks under commands around the speed limit of the joints: they slow down, and say so."""

from __future__ import annotations

import numpy as np
import pytest

from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.scenario.reading import load_scenario

SHARES = (0.8, 1.0, 1.2)  # of the largest command that the joints can follow
SOFT = 0.7  # body weights    largest peak force


@pytest.mark.parametrize("friction", ["tanh", "bristle"])
@pytest.mark.parametrize(
    ("scenario", "gait", "key", "limit"),
    [
        ("walk_flat", "tripod", "command.vx", 0.33),
        ("walk_flat", "amble", "command.vx", 0.19),
        ("turn", "tripod", "command.yaw_rate", 1.01),
    ],
)
def test_a_command_beyond_the_joints_is_walked_at_their_limit(
    scenario: str, gait: str, key: str, limit: float, friction: str
) -> None:
    given = ["control=compliant", f"gait.name={gait}", f"friction.law={friction}", "duration=5"]
    with Runner() as runner:
        results = [
            runner.simulate(load_scenario(scenario, overrides=[*given, f"{key}={share * limit}"]))
            for share in SHARES
        ]
    peaks = np.array([result.metrics["peak_force"] for result in results])
    assert (peaks < SOFT).all()
    assert np.abs(np.diff(peaks)).max() < 0.05  # no step at the limit
    for result, share in zip(results, SHARES, strict=True):
        recording = result.outcome.judged
        outrun = [f"controller.{leg}.outrun" for leg in ("LF", "LM", "LR", "RF", "RM", "RR")]
        assert recording.columns(outrun)[1:].any() == (share > 1.0)
        assert not recording.column("controller.LF.fallback").any()
    texts = [event["text"] for event in results[-1].facts.events]
    assert any("too fast for the joints of" in text for text in texts)
