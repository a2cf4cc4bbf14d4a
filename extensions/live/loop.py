"""The loop of a live robot, in a process of its own: steps it in real time, takes in what pages
asked for, and gives out its state.

The loop never waits for a page or for the server: it reads what has arrived, and sends a state only
when the server has taken the one before last. What it does not send is replaced by newer states.
"""

from __future__ import annotations

import gc
import signal
from collections import deque
from collections.abc import Callable
from dataclasses import astuple
from multiprocessing.connection import Connection
from time import sleep
from typing import Any, ClassVar, Protocol

from hexapod_cosim.controller import BodyCommand, Gains
from hexapod_cosim.extensions.live import state
from hexapod_cosim.extensions.live.pacing import Pacer, wall_time
from hexapod_cosim.extensions.live.protocol import Action, Change, Drive, Ping, Push
from hexapod_cosim.extensions.live.robot import MOST_WEIGHTS, LiveRobot
from hexapod_cosim.extensions.live.settings import Choices, Settings
from hexapod_cosim.extensions.live.take import NO_FORCE, Force, Take
from hexapod_cosim.models import HexapodError

FRAME = 0.02  # s    between two states that are sent
UNSEEN = 2  # messages that the server may not have taken yet
SILENCE = 1.0  # s    after which a drive or push that was not renewed ends
IDLE = 0.05  # s    between two looks for messages while the loop pauses
MOST_MESSAGES = 200  # that are read before a macro-step
MOST_NOTES = 5  # sentences for pages that are kept
HALTS = "only built-in controls take over a walk without a stop."
UNCHANGED = "before the first change of gait, control or friction."
FREE, RECORDING, REPLAYING = "free", "recording", "replaying"


class Link(Protocol):
    """The loop's end of the connection with the server."""

    def poll(self, timeout: float = 0.0) -> bool:
        """Returns whether a message has arrived, after at most `timeout` [s]."""

    def recv(self) -> Any:
        """Returns the next message. Raises EOFError when the server is gone."""

    def send(self, message: Any) -> None:
        """Sends a message. Raises OSError when the server is gone."""


class Loop:
    """Steps a robot in real time between messages (kind, client, content).

    `now` and `pause` are the wall clock [s] and the way to wait for it.
    """

    def __init__(
        self,
        robot: LiveRobot,
        link: Link,
        *,
        now: Callable[[], float] = wall_time,
        pause: Callable[[float], None] = sleep,
    ) -> None:
        self.robot, self._link, self._now, self._pause = robot, link, now, pause
        h = robot.plan.scenario.macro_step
        self.pacer = Pacer(h, now)
        self._every = max(round(FRAME / h), 1)
        self._drive, self._driver, self._driven = Drive(), 0, 0.0
        self._force: Force = NO_FORCE
        self._pusher, self._pushed = 0, 0.0
        self._clients, self._paused, self.ended = 0, False, False
        self._credit, self._echo = UNSEEN, dict[int, float]()
        self._notes: deque[tuple[int, str]] = deque(maxlen=MOST_NOTES)
        self._note_count = self._placed = 0
        self._mode, self._take = FREE, Take(robot.plan.scenario)
        self._take_settings: Settings = robot.settings
        self._sent: dict[str, Any] = {}  # last messages of each kind but frames
        self._command: tuple[float, ...] = (0.0,) * 4  # vx vy yaw_rate height, of the last step
        self._shown = -1  # macro-step of the last frame
        self._world: dict[str, Any] = state.world_of(robot)

    # ------------------------------------------------------------------------------- running

    def run(self) -> None:
        """Runs until the server ends it or is gone."""
        try:
            while not self.ended:
                self.turn()
        except (EOFError, OSError):
            return

    def turn(self) -> None:
        """Takes in messages, waits until the next macro-step is due, and makes it."""
        self._receive()
        if self.ended:
            return
        if not self._goes:
            self._send(frame=self._shown < 0)
            self._link.poll(IDLE)
            self.pacer.restart()
            return
        left = self.pacer.wait()
        if left > 0.0:
            self._pause(left)
        self.step()
        self.pacer.stepped()
        if self.pacer.lateness.steps % self._every == 0:
            self._send(frame=True)

    @property
    def _goes(self) -> bool:
        """Whether the robot is stepped: it has a page, and nobody has paused it."""
        return self._clients > 0 and not self._paused

    def step(self) -> None:
        """Makes one macro-step under the present inputs."""
        if self._mode == REPLAYING:
            for change in self._take.changes_at(self.robot.count):
                self.robot.change(change)
        command, force = self._inputs()
        self._command = astuple(command)[:4]
        before = self.robot.fault
        self.robot.step(command, force)
        if self._mode == RECORDING:
            self._take.note(command, force)
        if self._mode != FREE and (self.robot.fault or self._take_ends):
            self._end_take()
        if self.robot.fault and self.robot.fault != before:
            self._tell(self.robot.fault)

    @property
    def _take_ends(self) -> bool:
        if self._mode == RECORDING:
            return self._take.full
        return self.robot.count >= self._take.steps

    def _inputs(self) -> tuple[BodyCommand, Force]:
        """Returns the command and the force of the next macro-step.

        A drive that was not renewed for SILENCE stops walking, and keeps the height.
        """
        if self._mode == REPLAYING:
            return self._take.input(self.robot.count)
        now = self._now()
        if self._drive.moves and now - self._driven > SILENCE:
            self._drive = Drive(height=self._drive.height)
        if self._force != NO_FORCE and now - self._pushed > SILENCE:
            self._force = NO_FORCE
        return self.robot.limits.command(self._drive), self._force

    # ------------------------------------------------------------------------------- messages

    def _receive(self) -> None:
        """Takes in the messages that have arrived."""
        for _ in range(MOST_MESSAGES):
            if not self._link.poll(0.0):
                return
            kind, client, content = self._link.recv()
            self._handlers[kind](self, client, content)

    def _on_drive(self, client: int, drive: Drive) -> None:
        self._drive, self._driver, self._driven = drive, client, self._now()
        self._echo[client] = drive.stamp

    def _on_push(self, client: int, push: Push) -> None:
        most = MOST_WEIGHTS * self.robot.weight
        size = sum(part * part for part in push.force) ** 0.5
        share = min(most / size, 1.0) if size else 0.0
        x, y, z = (share * part for part in push.force)
        self._force, self._pusher, self._pushed = (x, y, z), client, self._now()

    def _on_ping(self, client: int, ping: Ping) -> None:
        self._echo[client] = ping.stamp

    def _on_set(self, client: int, change: Change) -> None:
        """Changes a setting; a recording goes on, a replay ends."""
        self._attempt(client, lambda: self._change(change))

    def _change(self, change: Change) -> None:
        before = self.robot.wanted or self.robot.settings
        if self.robot.choices.changed(before, change) == before:
            return
        count = self.robot.count
        self.robot.change(change)
        placed = self.robot.count < count or change.key == "ground"
        if self.robot.halts and change.key in {"control", "gait"}:
            self._tell(f"The robot stops, and walks on with {change.value}: {HALTS}")
        if self._mode == RECORDING and not placed:
            self._take.note_change(change)
            return
        self._end_take()
        if placed:
            self._note_placed()

    def _on_do(self, client: int, action: Action) -> None:
        self._attempt(client, lambda: self._actions[action.name](self))

    def _attempt(self, client: int, act: Callable[[], None]) -> None:
        """Does what a page asked for, and tells pages why it was refused."""
        try:
            act()
        except HexapodError as error:
            self._tell(str(error))

    def _place(self) -> None:
        self._end_take()
        self.robot.place()
        self._note_placed()

    def _record(self) -> None:
        """Places the robot and records what it is told from then on."""
        self._place()
        self._take, self._take_settings = Take(self.robot.plan.scenario), self.robot.settings
        self._mode = RECORDING

    def _replay(self) -> None:
        """Places the robot and repeats what was recorded."""
        self._end_take()
        if self._take.steps == 0:
            self._tell("Nothing is recorded yet: press Record, drive, and press Stop.")
            return
        self.robot.place(self._take_settings)
        self._note_placed()
        self._mode = REPLAYING

    def _end_take(self) -> None:
        """Ends a recording or a replay; a recording is given to the server as a scenario."""
        if self._mode == RECORDING and self._take.steps > 0:
            kept = self._take.kept * self._take.scenario.macro_step
            self._put("take", self._take.as_toml() if kept else "")
            self._tell(f"Recorded {self._take.duration:.1f} s.")
            if self._take.changes:
                self._tell(f"Replay repeats all of it, Save gives the {kept:.1f} s {UNCHANGED}")
        elif self._mode == REPLAYING:
            self._tell("The replay has ended.")
        self._mode = FREE

    def _set_paused(self, paused: bool) -> None:
        self._paused = paused

    def _note_placed(self) -> None:
        """Notes that the robot has jumped to its start, perhaps on other ground."""
        self._placed += 1
        self._world = state.world_of(self.robot)
        self.pacer.restart()

    def _on_clients(self, _client: int, count: int) -> None:
        self._clients = count

    def _on_left(self, client: int, _content: Any) -> None:
        """Stops what a page that was closed has asked for."""
        self._echo.pop(client, None)
        if client == self._driver:
            self._drive = Drive(height=self._drive.height)
        if client == self._pusher:
            self._force = NO_FORCE

    def _on_taken(self, _client: int, count: int) -> None:
        self._credit = min(self._credit + count, UNSEEN)

    def _on_end(self, _client: int, _content: Any) -> None:
        self.ended = True

    _handlers: ClassVar[dict[str, Callable[[Any, int, Any], None]]] = {
        "drive": _on_drive, "push": _on_push, "ping": _on_ping, "set": _on_set, "do": _on_do,
        "clients": _on_clients, "left": _on_left, "taken": _on_taken, "end": _on_end,
    }  # fmt: skip
    _actions: ClassVar[dict[str, Callable[[Any], None]]] = {
        "place": _place, "record": _record, "stop": _end_take, "replay": _replay,
        "pause": lambda self: self._set_paused(True),
        "resume": lambda self: self._set_paused(False),
    }  # fmt: skip

    # ------------------------------------------------------------------------------- output

    def _tell(self, text: str) -> None:
        """Adds a sentence for all pages."""
        self._note_count += 1
        self._notes.append((self._note_count, text))

    def status(self) -> dict[str, Any]:
        """Returns what pages show besides the motion; equal ones are sent once."""
        robot, wanted = self.robot, self.robot.wanted
        return {
            "settings": vars(robot.settings),
            "wanted": None if wanted is None else vars(wanted),
            "limits": vars(robot.limits),
            "fault": robot.fault,
            "stopped": robot.stopped,
            "paused": self._paused,
            "mode": self._mode,
            "recorded": self._take.steps > 0 and self._mode != RECORDING,
            "notes": list(self._notes),
        }

    def _send(self, *, frame: bool) -> None:
        """Sends what has changed, as far as the server takes it."""
        self._put("world", self._world)
        self._put("status", self.status())
        if not frame or self._credit <= 0:
            return
        self._credit -= 1
        self._shown = self.robot.count
        content = state.frame_of(self.robot, self.pacer) | {
            "placed": self._placed,
            "driver": self._driver,
            "command": [round(value, 5) for value in self._command],
            "seconds": self.robot.count * self.robot.plan.scenario.macro_step,
            "echo": {str(client): stamp for client, stamp in self._echo.items()},
        }
        self._echo.clear()
        self._link.send(("frame", content))

    def _put(self, kind: str, content: Any) -> None:
        """Sends a message of a kind that must not be lost, if it has changed."""
        if self._sent.get(kind) != content:
            self._sent[kind] = content
            self._link.send((kind, content))


def run_process(link: Connection, choices: Choices, gains: Gains | None) -> None:
    """Runs the loop of a new process. Ctrl-C is left to the server, which ends the loop."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with LiveRobot(choices, gains=gains) as robot:
            gc.collect()
            gc.freeze()  # collections look at what is new alone, and stay short
            link.send(("ready", None))
            Loop(robot, link).run()
    except HexapodError as error:
        link.send(("refused", error))
