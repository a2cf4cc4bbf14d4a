"""The loop of a live robot, in a thread of its own: steps it in real time, takes in what pages
asked for, and publishes its state.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from queue import Empty, SimpleQueue
from time import monotonic, sleep
from typing import Any

from hexapod_cosim.controller import BodyCommand
from hexapod_cosim.extensions.live import page
from hexapod_cosim.extensions.live.messages import Action, Change, Drive, Leg, Message, Push
from hexapod_cosim.extensions.live.recording import LONGEST, NO_FORCE, Force, Recording
from hexapod_cosim.extensions.live.robot import MOST_WEIGHTS, LiveRobot
from hexapod_cosim.models import LEG_NAMES, HexapodError

FRAME = 0.02  # s    between two states that are published
SILENCE = 1.0  # s    after which a drive or push that was not renewed ends
IDLE = 0.05  # s    between two looks for messages while the loop pauses
MOST_WAITING = 200  # messages; more are dropped
MOST_LAG = 0.1  # s    behind wall time
WINDOW = 1.0  # s    over which the real-time factor is taken

Publish = Callable[[str, Any], None]  # kind and content of a message for all pages


class Pacer:
    """Computes the time to wait before a macro-step of `h` [s]; `now` returns wall time [s].

    Step k is due to begin at t_k = origin + k h. A lag of less than MOST_LAG is made up by steps
    without a pause between them. After a larger one the origin moves: the gap is skipped and
    counted.

    Attributes:
        steps: macro-steps since the loop began.
        skipped: wall time [s] in gaps.
    """

    def __init__(self, h: float, now: Callable[[], float]) -> None:
        self._h, self._now = h, now
        self.steps, self.skipped = 0, 0.0
        self._ends: deque[float] = deque(maxlen=max(round(WINDOW / h), 2) + 1)
        self.restart()

    def restart(self) -> None:
        """Makes the next step due now, after a pause that was asked for; nothing is counted."""
        self._due = self._now()
        self._ends.clear()

    def wait(self) -> float:
        """Returns the time [s] until the next step is due; skips a gap that is too large."""
        left = self._due - self._now()
        if left < -MOST_LAG:
            self.skipped -= left
            self.restart()
            return 0.0
        return max(left, 0.0)

    def note_step(self) -> None:
        """Notes that the step that was due has ended."""
        self._due += self._h
        self.steps += 1
        self._ends.append(self._now())

    @property
    def factor(self) -> float:
        """Simulated time over wall time of the last second; 0 before two steps."""
        if len(self._ends) < 2 or self._ends[-1] <= self._ends[0]:
            return 0.0
        return (len(self._ends) - 1) * self._h / (self._ends[-1] - self._ends[0])


class Loop:
    """Steps a robot in real time.

    Args:
        robot: the robot.
        publish: is called with kind and content of each message for pages; it must not wait.
        now, pause: the wall clock [s] and the way to wait for it.

    Attributes:
        pages: number of connected pages, which the server sets; without any the robot waits.
        ended: ends `run` when set.
    """

    def __init__(
        self,
        robot: LiveRobot,
        publish: Publish,
        *,
        now: Callable[[], float] = monotonic,
        pause: Callable[[float], None] = sleep,
    ) -> None:
        self.robot, self._publish, self._now, self._pause = robot, publish, now, pause
        self.pacer = Pacer(robot.h, now)
        self.pages, self.ended, self._paused = 0, False, False
        self._inbox: SimpleQueue[Message] = SimpleQueue()
        self._drive, self._driven = Drive(), 0.0
        self._force, self._pushed = NO_FORCE, 0.0
        self._command = BodyCommand()  # of the last macro-step
        self._recording: Recording | None = None
        self._saved = ""  # the last recording, as a scenario file
        self._placed = 0
        self._sent: dict[str, Any] = {}  # last messages of each kind but frames

    def post(self, message: Message) -> None:
        """Gives a page's message to the loop, from any thread."""
        if self._inbox.qsize() < MOST_WAITING:
            self._inbox.put(message)

    # ------------------------------------------------------------------------------- running

    def run(self) -> None:
        """Runs until the server ends it."""
        self._note_placed()
        while not self.ended:
            self.turn()

    def turn(self) -> None:
        """Takes in messages, waits until the next macro-step is due, and makes it."""
        self._receive()
        if self._paused or self.pages == 0:
            self._publish_if_new("status", self.status())
            self._pause(IDLE)
            self.pacer.restart()
            return
        left = self.pacer.wait()
        if left > 0.0:
            self._pause(left)
        self.step()
        self.pacer.note_step()
        if self.pacer.steps % max(round(FRAME / self.robot.h), 1) == 0:
            self._publish_if_new("status", self.status())
            self._publish_frame()

    def step(self) -> None:
        """Makes one macro-step under the present inputs."""
        self._command, force = self._inputs()
        before, absent = self.robot.fault, set(self.robot.absent)
        self.robot.step(self._command, force)
        if self._recording is not None:
            self._recording.note(self._command, force, self.robot.limp)
            if self.robot.fault or self._recording.duration >= LONGEST:
                self._end_recording()
        if self.robot.fault != before:
            self._note(self.robot.fault)
        for leg in sorted(absent ^ set(self.robot.absent)):
            how = "with" if leg in absent else "without"
            self._note(f"The controller walks {how} leg {LEG_NAMES[leg]}.")

    def _inputs(self) -> tuple[BodyCommand, Force]:
        """Returns the command and the force of the next macro-step.

        A drive that was not renewed for SILENCE stops walking, and keeps the height.
        """
        if self._now() - self._driven > SILENCE:
            self._drive = Drive(height=self._drive.height)
        if self._now() - self._pushed > SILENCE:
            self._force = NO_FORCE
        return self.robot.limits.command(self._drive), self._force

    # ------------------------------------------------------------------------------- messages

    def _receive(self) -> None:
        """Takes in the messages that have arrived; says to pages why one was refused."""
        try:
            for _ in range(MOST_WAITING):
                self._take_in(self._inbox.get_nowait())
        except Empty:
            return
        except HexapodError as error:
            self._note(str(error))

    def _take_in(self, message: Message) -> None:
        match message:
            case Drive():
                self._drive, self._driven = message, self._now()
            case Push():
                self._push(message)
            case Change():
                self._change(message)
            case Action():
                self._act(message.action)
            case Leg():
                self._note(self.robot.toggle_leg(message.leg))

    def _push(self, push: Push) -> None:
        size = (push.x**2 + push.y**2 + push.z**2) ** 0.5
        share = min(MOST_WEIGHTS * self.robot.weight / size, 1.0) if size else 0.0
        self._force = (share * push.x, share * push.y, share * push.z)
        self._pushed = self._now()

    def _change(self, change: Change) -> None:
        """Changes a setting; a recording ends, because a scenario has one of each."""
        wanted, count = self.robot.wanted, self.robot.count
        self.robot.change(change)
        if self.robot.wanted == wanted:
            return
        self._end_recording()
        if self.robot.count < count or change.key == "ground":
            self._note_placed()

    def _act(self, action: str) -> None:
        if action in ("pause", "resume"):
            self._paused = action == "pause"
            return
        self._end_recording()
        if action == "stop":
            return
        self.robot.place()
        self._note_placed()
        if action == "record":
            self._recording = Recording(self.robot.plan.scenario)

    def _end_recording(self) -> None:
        """Ends a recording and publishes it as a scenario."""
        recording, self._recording = self._recording, None
        if recording is None or not recording.steps:
            return
        self._saved = recording.as_toml()
        self._publish("recording", self._saved)
        self._note(f"Recorded {recording.duration:.1f} s.")

    def _note_placed(self) -> None:
        """Notes that the robot has jumped to its start, perhaps on other ground."""
        self._placed += 1
        self.pacer.restart()
        self._publish_if_new("world", self._world())
        self._publish_if_new("status", self.status())
        self._publish_frame()

    # ------------------------------------------------------------------------------- output

    def _world(self) -> dict[str, Any]:
        return page.describe_world(self.robot.plan.robot, self.robot.parameters, self.robot.h)

    def _note(self, text: str) -> None:
        """Publishes a sentence."""
        if text:
            self._publish("note", {"text": text})

    def status(self) -> dict[str, Any]:
        """Returns what pages show besides the motion."""
        robot = self.robot
        return {
            "settings": vars(robot.settings),
            "wanted": vars(robot.wanted),
            "limits": vars(robot.limits),
            "fault": robot.fault,
            "stopped": robot.stopped,
            "paused": self._paused,
            "recording": self._recording is not None,
            "recorded": bool(self._saved),
        }

    def _publish_frame(self) -> None:
        command = self._command
        self._publish(
            "frame",
            page.frame_of(self.robot)
            | {
                "late": {
                    "factor": round(self.pacer.factor, 4),
                    "skipped": round(self.pacer.skipped, 3),
                },
                "placed": self._placed,
                "command": [command.vx, command.vy, command.yaw_rate, command.height],
            },
        )

    def _publish_if_new(self, kind: str, content: Any) -> None:
        """Publishes a message of a kind that pages keep, if it has changed."""
        if self._sent.get(kind) != content:
            self._sent[kind] = content
            self._publish(kind, content)
