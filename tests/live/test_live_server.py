"""The server of a live robot: who may reach it, what pages get, and what abuse of it leads to."""

from __future__ import annotations

import http.client
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.extensions.live.hub import BURST, MOST_CLIENTS, MOST_DROPPED, MOST_REFUSED, Hub
from hexapod_cosim.extensions.live.loop import run_process
from hexapod_cosim.extensions.live.pacing import MOST_LAG
from hexapod_cosim.extensions.live.server import LiveError, LiveServer
from hexapod_cosim.extensions.live.settings import Choices, control_texts
from hexapod_cosim.models import HexapodError

Process = Callable[[Connection, Choices, Gains | None], None]
PATIENCE = 180.0  # s    for a loaded machine; nothing is asserted about it


def choices() -> Choices:
    scenario = load_scenario("walk_flat")
    return Choices(scenario, control_texts(scenario, ("kinematic",)), {})


class Running:
    """A server in a thread, and what its `run` raised."""

    def __init__(self, process: Process = run_process) -> None:
        self.server = LiveServer(choices(), None, process=process)
        self.error: HexapodError | None = None
        self.ready = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        assert self.ready.wait(PATIENCE)
        self.port, self.token = self.server.address.port, self.server.address.token

    def _run(self) -> None:
        try:
            self.server.run(lambda url: self.ready.set())
        except HexapodError as error:
            self.error = error

    def get(self, path: str, **headers: str) -> tuple[int, str, dict[str, str]]:
        """Returns status, text and headers of a page."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE)
        connection.request("GET", path, headers={key.title(): it for key, it in headers.items()})
        answer = connection.getresponse()
        text = answer.read().decode()
        connection.close()
        return answer.status, text, {key.lower(): it for key, it in answer.getheaders()}

    @contextmanager
    def socket(
        self, *, origin: str | None = "ours", token: str | None = None, host: str = "127.0.0.1"
    ) -> Iterator[Any]:
        """Opens a socket as a page does."""
        origin = f"http://{host}:{self.port}" if origin == "ours" else origin
        url = f"ws://127.0.0.1:{self.port}/{token or self.token}/socket"
        with connect(url, origin=origin, compression=None) as opened:  # type: ignore[arg-type]
            yield opened

    def end(self) -> None:
        """Ends the server and waits for it."""
        self.server.stop()
        self._thread.join(PATIENCE)
        assert not self._thread.is_alive()


@pytest.fixture(scope="module")
def running() -> Iterator[Running]:
    made = Running()
    yield made
    made.end()
    assert made.error is None


def until(opened: Any, holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """Returns the first message for which a condition holds."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        message: dict[str, Any] = json.loads(opened.recv(PATIENCE))
        if holds(message):
            return message
    pytest.fail("no such message")


def of(kind: str) -> Callable[[dict[str, Any]], bool]:
    return lambda message: message["type"] == kind


def test_the_page_is_one_file_that_may_load_nothing_else(running: Running) -> None:
    code, text, headers = running.get(f"/{running.token}/")
    assert code == 200
    assert "hexapod" in text
    assert "connect-src 'self' ws://127.0.0.1:" in headers["content-security-policy"]
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["cache-control"] == "no-store"
    assert 'src="http' not in text


def test_another_token_host_or_origin_is_refused(running: Running) -> None:
    page = f"/{running.token}/"
    assert running.get("/")[0] == 404
    assert running.get("/wrong/")[0] == 404
    assert running.get(f"/{running.token[:-1]}/")[0] == 404
    assert running.get("/wrong", host="evil.example")[0] == 404  # no redirection
    assert running.get(page, host="robot.example.org")[0] == 403
    assert running.get(page, host=f"robot.example.org:{running.port}")[0] == 403
    assert running.get(page, origin="http://example.org")[0] == 403
    assert running.get(page, host=f"localhost:{running.port}")[0] == 200
    assert running.get(f"/{running.token}/scenario.toml")[0] == 404  # nothing is recorded yet


@pytest.mark.parametrize(
    "wrong",
    [
        {"origin": "http://example.org"},
        {"origin": "null"},
        {"origin": None},
        {"token": "wrong"},
        {"host": "example.org"},
    ],
)
def test_a_socket_of_another_page_is_refused(running: Running, wrong: dict[str, Any]) -> None:
    with pytest.raises(InvalidStatus) as caught, running.socket(**wrong):
        pass
    assert caught.value.response.status_code == 403
    assert running.server.hub.clients == {}


def test_the_server_listens_on_the_loopback_address_alone(running: Running) -> None:
    assert running.server.address.url.startswith("http://127.0.0.1:")
    assert len(running.token) >= 20


def test_two_pages_see_one_robot_and_the_last_command_wins(running: Running) -> None:
    with running.socket() as one, running.socket() as two:
        first, second = (until(opened, of("hello"))["client"] for opened in (one, two))
        assert first != second
        until(one, lambda message: message["type"] == "pages" and message["count"] == 2)
        one.send(json.dumps({"type": "drive", "forward": 1, "speed": 0.5, "stamp": 17}))
        until(two, lambda m: m["type"] == "frame" and m["driver"] == first and m["command"][0] > 0)
        two.send(json.dumps({"type": "drive", "turn": 1, "stamp": 18}))
        frame = until(one, lambda m: m["type"] == "frame" and m["driver"] == second)
        assert frame["command"][0] == 0.0
        assert frame["command"][2] > 0.0


def test_a_tab_that_is_closed_while_it_drives_lets_go_of_the_robot(running: Running) -> None:
    with running.socket() as stays:
        with running.socket() as closed:
            until(stays, lambda message: message["type"] == "pages" and message["count"] == 2)
            closed.send(json.dumps({"type": "drive", "forward": 1, "speed": 0.5}))
            until(stays, lambda m: m["type"] == "frame" and m["command"][0] > 0)
            closed.socket.shutdown(socket.SHUT_RDWR)  # as a browser that is killed: no farewell
        until(stays, lambda message: message["type"] == "pages" and message["count"] == 1)
        until(stays, lambda m: m["type"] == "frame" and m["command"][0] == 0)
        # and the page that stays can drive
        stays.send(json.dumps({"type": "drive", "turn": 1, "speed": 0.5}))
        until(stays, lambda m: m["type"] == "frame" and m["command"][2] > 0)


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="no SIGSTOP on this system")
def test_after_a_sleep_of_the_computer_the_loop_goes_on_and_counts_what_it_missed(
    running: Running,
) -> None:
    with running.socket() as opened:
        before = until(opened, of("frame"))
        loop = running.server._process.pid
        assert loop is not None
        os.kill(loop, signal.SIGSTOP)
        asleep = time.monotonic()
        try:
            while time.monotonic() < asleep + 2.0 * MOST_LAG:  # a sleep is a gap of the clock
                time.sleep(MOST_LAG)
        finally:
            os.kill(loop, signal.SIGCONT)
        after = until(
            opened,
            lambda m: (
                m["type"] == "frame"
                and m["gaps"] > before["gaps"]
                and m["skipped"] - before["skipped"] > MOST_LAG
            ),
        )
        until(opened, lambda m: m["type"] == "frame" and m["seconds"] > after["seconds"] + 0.1)


SERVER = """
from hexapod_cosim.extensions.live.server import LiveServer
from hexapod_cosim.extensions.live.settings import Choices, control_texts
from hexapod_cosim.cosim.scenario.scenario import load_scenario

if __name__ == "__main__":
    scenario = load_scenario("walk_flat")
    choices = Choices(scenario, control_texts(scenario, ("kinematic",)), {})
    LiveServer(choices, None).run(lambda url: print(url, flush=True))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")
def test_when_the_server_is_killed_its_loop_ends_too(tmp_path: Path) -> None:
    (tmp_path / "serve.py").write_text(SERVER, encoding="utf-8")
    command = [sys.executable, str(tmp_path / "serve.py")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert any("http://127.0.0.1:" in line for line in server.stdout or ())
            tasks = Path(f"/proc/{server.pid}/task").glob("*/children")
            listed = " ".join(path.read_text(encoding="utf-8") for path in tasks)
        finally:
            server.kill()
    children = [Path("/proc", word) for word in listed.split()]
    assert children
    end = time.monotonic() + PATIENCE
    while any(map(is_running, children)) and time.monotonic() < end:
        time.sleep(0.05)
    assert not any(map(is_running, children))


def is_running(process: Path) -> bool:
    """Returns whether a process of /proc exists and is not only waiting for its parent."""
    try:
        return "State:\tZ" not in (process / "status").read_text(encoding="utf-8")
    except OSError:
        return False


def test_what_is_recorded_can_be_fetched(running: Running) -> None:
    with running.socket() as opened:
        opened.send(json.dumps({"type": "do", "action": "record"}))
        until(opened, lambda m: m["type"] == "status" and m["mode"] == "recording")
        until(opened, lambda m: m["type"] == "frame" and m["seconds"] > 0.1)
        opened.send(json.dumps({"type": "do", "action": "stop"}))
        until(opened, lambda m: m["type"] == "status" and m["recorded"])
    code, text, headers = running.get(f"/{running.token}/scenario.toml")
    assert code == 200
    assert 'title = "Walk on flat ground, driven by hand"' in text
    assert headers["content-disposition"] == 'attachment; filename="driven.toml"'


def closing(opened: Any) -> ConnectionClosed:
    """Reads until the server closes the connection; returns how it did."""
    with pytest.raises(ConnectionClosed) as caught:
        until(opened, lambda message: False)
    return caught.value


def test_a_page_that_floods_the_socket_is_closed_and_another_one_does_not_notice(
    running: Running,
) -> None:
    with running.socket() as calm, running.socket() as flooding:
        text = json.dumps({"type": "ping", "stamp": 1})
        with suppress(ConnectionClosed):
            for _ in range(20 * MOST_DROPPED):
                flooding.send(text)
        end = closing(flooding)
        assert end.rcvd is not None
        assert (end.rcvd.code, end.rcvd.reason) == (1008, "too many messages")
        steps = until(calm, of("frame"))["steps"]
        assert until(calm, lambda m: m["type"] == "frame" and m["steps"] > steps + 20)


def test_nonsense_is_answered_and_after_a_while_ends_the_connection(running: Running) -> None:
    with running.socket() as opened:
        opened.send("nonsense")
        assert "not a message" in until(opened, of("refused"))["reason"]
        for _ in range(MOST_REFUSED):
            opened.send(b"\xff\x00")
        end = closing(opened)
        assert end.rcvd is not None
        assert end.rcvd.reason == "too many messages were not valid"


def test_too_large_a_message_ends_the_connection(running: Running) -> None:
    with running.socket() as opened:
        opened.send("x" * 10_000)
        end = closing(opened)
        assert end.rcvd is not None
        assert end.rcvd.code == 1009


def test_a_page_too_many_is_told_so(running: Running) -> None:
    end = time.monotonic() + PATIENCE
    while running.server.hub.clients and time.monotonic() < end:  # those of the tests before
        time.sleep(0.01)
    opened = []
    try:
        for _ in range(MOST_CLIENTS):
            manager = running.socket()
            opened.append((manager, manager.__enter__()))
            until(opened[-1][1], of("hello"))
        with running.socket() as one_more:
            refusal = closing(one_more)
            assert refusal.rcvd is not None
            assert refusal.rcvd.code == 1013
    finally:
        for manager, _ in opened:
            manager.__exit__(None, None, None)


def test_a_loop_that_dies_ends_the_server_which_says_so() -> None:
    running = Running()
    with running.socket() as opened:
        until(opened, of("frame"))
        process = running.server._process
        process.kill()
        closing(opened)
    running.end()
    assert "the loop's process has ended by itself" in str(running.error)


def refuse_later(link: Connection, _choices: Choices, _gains: Gains | None) -> None:
    """Runs a loop that cannot go on as soon as it has a page."""
    link.send(("ready", None))
    while link.recv() != ("clients", 0, 1):
        pass
    link.send(("refused", HexapodError("the robot has gone", fix="fetch it")))


def test_a_loop_that_cannot_go_on_ends_the_server_which_says_why() -> None:
    running = Running(refuse_later)
    with running.socket() as opened:
        closing(opened)
    running.end()
    assert str(running.error) == "the robot has gone; fetch it"


def test_a_port_that_is_taken_is_refused(running: Running) -> None:
    with pytest.raises(LiveError, match="cannot listen on this port"):
        LiveServer(choices(), None, port=running.port)


class Poster:
    """Collects what a hub gives to the loop."""

    def __init__(self) -> None:
        self.posted: list[tuple[str, int, Any]] = []

    def post(self, kind: str, client: int, content: Any) -> None:
        self.posted.append((kind, client, content))


def test_a_hub_drops_what_exceeds_the_rate_of_a_page() -> None:
    poster, clock = Poster(), [0.0]
    hub = Hub(poster, now=lambda: clock[0])
    client = hub.join()
    assert client is not None
    text = json.dumps({"type": "ping", "stamp": 1})
    for _ in range(1000):
        assert hub.from_page(client, text) is None
    assert [kind for kind, _, _ in poster.posted].count("ping") == BURST
    assert client.dropped == 1000 - BURST
    clock[0] = 1.0
    hub.from_page(client, text)
    assert [kind for kind, _, _ in poster.posted].count("ping") == BURST + 1


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("set", '{"type": "set", "key": "friction", "value": 0.5}'),
        ("do", '{"type": "do", "action": "pause"}'),
    ],
)
def test_settings_and_actions_above_their_rate_are_dropped_and_never_close_a_page(
    kind: str, text: str
) -> None:
    poster, clock = Poster(), [0.0]
    hub = Hub(poster, now=lambda: clock[0])
    client = hub.join()
    assert client is not None
    for _ in range(30):
        assert hub.from_page(client, text) is None
    assert [one for one, _, _ in poster.posted].count(kind) == 20
    # then 50 in each second for 400 s, which is below the rate of all messages
    for _ in range(20_000):
        clock[0] += 0.02
        assert hub.from_page(client, text) is None
    assert [one for one, _, _ in poster.posted].count(kind) == pytest.approx(4020, abs=1)
    assert client.dropped == pytest.approx(16_010, abs=1)


@pytest.mark.parametrize(
    ("text", "at_once", "rate", "reason"),
    [
        ("nonsense", 20, 0.1, "too many messages were not valid"),
        ('{"type": "ping", "stamp": 1}', 2200, 20.0, "too many messages"),
    ],
)
def test_what_a_page_did_wrong_is_forgotten_in_time(
    text: str, at_once: int, rate: float, reason: str
) -> None:
    clock = [0.0]
    hub = Hub(Poster(), now=lambda: clock[0])
    steady, sudden = hub.join(), hub.join()
    assert steady is not None
    assert sudden is not None
    for _ in range(at_once):
        assert hub.from_page(sudden, text) is None
    assert hub.from_page(sudden, text) == reason
    # half as often as it is forgotten, for a day
    allowed = 100.0 if reason == "too many messages" else 0.0
    for _ in range(1000):
        clock[0] += 1.0 / rate
        for _ in range(int(allowed / rate)):
            assert hub.from_page(steady, text) is None
        assert hub.from_page(steady, text) is None


def test_a_page_that_reads_nothing_holds_the_newest_state_alone() -> None:
    hub = Hub(Poster())
    client = hub.join()
    assert client is not None
    for number in range(10_000):
        hub.from_loop("frame", {"number": number})
    assert set(client._slots) == {"hello", "pages", "frame"}
    assert json.loads(client._slots["frame"])["number"] == 9999
