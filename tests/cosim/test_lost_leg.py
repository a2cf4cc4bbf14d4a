"""The scenario `lost_leg`: the robot notices a lost leg, walks on, and takes the leg back."""

from __future__ import annotations

import numpy as np
import pytest

from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.scenario.reading import load_scenario


# the paper's law corrects no path, so that a torso which turned while it tipped stays turned
@pytest.mark.parametrize(("control", "path_error"), [("compliant", 0.05), ("paper", 0.08)])
def test_a_robot_that_loses_a_leg_walks_on_at_its_pace_and_takes_the_leg_back(
    control: str, path_error: float
) -> None:
    with Runner() as runner:
        result = runner.simulate(load_scenario("lost_leg", overrides=[f"control={control}"]))
    recording = result.outcome.judged
    gone = recording.time[recording.column("controller.LM.absent") > 0.5]
    assert 4.0 < gone[0] < 5.5  # the leg is lost at 4 s; a gait cycle takes 1.5 s
    assert 10.2 < gone[-1] < 12.5  # it works again at 9 s
    assert not recording.column("controller.RM.absent").any()
    texts = [event["text"] for event in result.facts.events]
    assert texts.index("the controller walks without LM") < texts.index(
        "the controller walks with LM again"
    )
    place = recording.column("torso.position[1]")
    pace = (np.interp(9.0, recording.time, place) - np.interp(7.0, recording.time, place)) / 2.0
    assert pace == pytest.approx(0.08, rel=0.1)
    assert result.metrics["path_error"] < path_error
    assert result.facts.walk.upright
