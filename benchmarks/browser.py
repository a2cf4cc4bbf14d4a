"""How many times faster than real time the robot walks in Chromium: `make bench-browser`.

The WebAssembly module of the page without a server (docs/live.md) is compiled by the browser and
walks for a while first; then the same walk is timed several times. Printed are wall time, which
other processes of a busy machine prolong, and on Linux the processor time of the browser's page
processes, which is what the walk costs.
"""

from __future__ import annotations

import argparse
import base64
import os
from pathlib import Path
from statistics import median
from typing import Any

from browser import launcher

from hexapod_cosim.controller import make_gait
from hexapod_cosim.extensions.live.module import walker_module
from hexapod_cosim.models import load_robot

CONTROLS = {"kinematic": 1, "compliant": 2, "paper": 3}
PATTERNS = {"tripod": 1, "ripple": 2, "wave": 3, "amble": 4}
STEP = 0.005  # s    macro-step of the module
WARM, TIMED = 10.0, 20.0  # s    of walking, before and in a repetition
SPEED = 0.08  # m/s
GOAL = 50.0

WALK = """async ([base64, walk, speed, warm, timed]) => {
  const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  const { instance } = await WebAssembly.instantiate(bytes, {});
  const robot = instance.exports;
  robot._initialize();
  new Float64Array(robot.memory.buffer, robot.hx_walker_wanted(), walk.length).set(walk);
  const checked = (status) => { if (status !== 0) throw new Error(`status ${status}`); };
  checked(robot.hx_walker_start(0.7));
  robot.hx_walker_command(speed, 0, 0, 0);
  checked(robot.hx_walker_advance(warm));
  window.walk = () => {
    const begin = performance.now();
    checked(robot.hx_walker_advance(timed));
    return performance.now() - begin;
  };
  window.speed = () => {
    const frame = new Float64Array(robot.memory.buffer, robot.hx_walker_frame(), 2);
    return frame[1] / frame[0];
  };
}"""


def processor_time() -> float:
    """Returns the processor time of the pages of this program's browser [s]; 0: unknown."""
    parents, spent = {}, {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
            page = b"--type=renderer" in (folder / "cmdline").read_bytes()
        except OSError:  # the process has ended
            continue
        parents[int(folder.name)] = int(fields[1])
        if page:
            spent[int(folder.name)] = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return sum(time for process, time in spent.items() if _is_ours(process, parents))


def _is_ours(process: int, parents: dict[int, int]) -> bool:
    while process in parents:
        if process == os.getpid():
            return True
        process = parents[process]
    return False


def factors(
    page: Any, control: str, gait: str, repetitions: int
) -> tuple[list[float], list[float], float]:
    """Returns simulated over wall time and over processor time of each repetition.

    The third value is the mean speed [m/s].
    """
    made = make_gait(load_robot("athena"), gait)
    numbers = (made.period, made.duty, made.step_height, made.touchdown_speed)
    walk = [CONTROLS[control], PATTERNS[gait], *numbers]
    module = base64.b64encode(walker_module()).decode("ascii")
    steps = [round(seconds / STEP) for seconds in (WARM, TIMED)]
    page.evaluate(WALK, [module, walk, SPEED, *steps])
    wall, spent = [], []
    for _ in range(repetitions):
        before = processor_time()
        wall.append(1e3 * TIMED / page.evaluate("window.walk()"))
        spent.append(TIMED / max(processor_time() - before, 1e-9) if before else 0.0)
    return wall, spent, page.evaluate("window.speed()")


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repetitions", type=int, default=5)
    repetitions = parser.parse_args().repetitions
    with launcher() as launch:
        browser = launch("--no-sandbox")
        page = browser.new_page()
        print(
            f"Chromium {browser.version}, {repetitions} x {TIMED:g} s of walking; goal {GOAL:g} x"
        )
        for control in CONTROLS:
            for gait in ("tripod", "amble"):
                wall, spent, speed = factors(page, control, gait, repetitions)
                print(
                    f"{control:10} {gait:7} wall time: median {median(wall):5.1f}, best"
                    f" {max(wall):5.1f}; processor time: median {median(spent):5.1f}, least"
                    f" {min(spent):5.1f}; walks at {speed:.3f} m/s"
                )
        browser.close()


if __name__ == "__main__":
    main()
