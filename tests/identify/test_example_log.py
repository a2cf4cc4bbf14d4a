"""The log of examples/05_robot_log.py, identified as a user does: its secret numbers are found, the
search ends at the optimum, and nothing is warned of.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from command import Call

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "05_robot_log.py"
SECRET = {
    "servo.kp": 34.0,
    "servo.coulomb_friction": 0.08,
    "friction.mu": 0.55,
    "torso.mass": 2.9,
    "contact.stiffness": 1.074e6,  # as in the robot file
}


def test_the_robot_of_the_example_is_identified(
    call: Call, tmp_path: Path, plant_build: Path
) -> None:
    log, place = tmp_path / "log.mcap", tmp_path / "out"
    subprocess.run([sys.executable, str(EXAMPLE), str(log)], check=True, capture_output=True)
    groups = [word for name in ("servo", "mass", "contact") for word in ("--find", name)]
    code, out, err = call("identify", log, "-o", place, *groups, "--json")
    assert code == 0
    assert "warning" not in err
    result = json.loads(out)
    assert result["deviations_from_optimum"] < 1.0
    own = {one["key"]: one for one in result["estimates"]}
    for key, value in SECRET.items():
        assert own[key]["determined"], key
        assert own[key]["low"] <= value <= own[key]["high"], key
    # of the legs' masses a walk of this length determines combinations alone
    legs = [own[f"links.{joint}.mass"] for joint in ("coxa", "femur", "tibia")]
    assert [one["determined"] for one in legs] == [False, False, False]
    before, after = (
        {one["channel"]: one[side] for one in result["held_out"]} for side in ("before", "after")
    )
    # the noise of the sensors is left
    assert after["torque"] < 0.031
    assert before["torque"] > 3.0 * after["torque"]
