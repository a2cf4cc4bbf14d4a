"""A controller made with pythonfmu: an FMU with names of its own, and without our package.

    pythonfmu build -f examples/controllers/stride.py -d out      (writes out/Stride.fmu)

The table in Stride.toml, beside the FMU, tells which of its names are ours. Its outputs are
computed in a step, so that they are one macro-step late, as in any other importer.
"""

import math

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

LEGS = ("LF", "LM", "LR", "RF", "RM", "RR")
JOINTS = ("coxa", "femur", "tibia")
STANCE = {"coxa": 0.0, "femur": 0.386, "tibia": 1.785}  # rad    as the robot stands
REACH = 0.18  # m    from coxa to foot


class Stride(Fmi2Slave):
    """Swings the legs as two tripods; the stride follows the speed `v`."""

    author = "hexapod-cosim"
    description = "Swings the legs as two tripods"

    def __init__(self, **facts):
        super().__init__(**facts)
        self.v, self.frequency, self.lift = 0.0, 1.0, 0.3
        self.register_variable(Real("v", causality=Fmi2Causality.input))  # m/s
        for name in ("frequency", "lift"):  # Hz, rad
            kinds = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.tunable}
            self.register_variable(Real(name, **kinds))
        for leg in LEGS:
            for joint in JOINTS:
                name = f"q_{leg}_{joint}"
                setattr(self, name, STANCE[joint])
                self.register_variable(Real(name, causality=Fmi2Causality.output))  # rad

    def do_step(self, current_time, step_size):
        """Computes the joint angles for the end of the step."""
        t = current_time + step_size
        ramp = min(t, 1.0)
        stride = ramp * self.v / (4.0 * self.frequency * REACH)
        for number, leg in enumerate(LEGS):
            phase = 2.0 * math.pi * self.frequency * t + math.pi * (number % 2)
            side = 1.0 if leg[0] == "L" else -1.0
            setattr(self, f"q_{leg}_coxa", STANCE["coxa"] + side * stride * math.cos(phase))
            lifted = ramp * self.lift * max(math.sin(phase), 0.0)
            setattr(self, f"q_{leg}_femur", STANCE["femur"] + lifted)
        return True
