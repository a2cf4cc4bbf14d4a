"""The server of a live robot: who may reach it, what pages get, and what abuse of it leads to."""

from __future__ import annotations

import asyncio
import http.client
import json
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.extensions.live.server import MOST_PAGES, LiveError, LiveServer, Page
from hexapod_cosim.extensions.live.settings import Choices, control_texts

PATIENCE = 180.0  # s    for a loaded machine; nothing is asserted about it


def choices() -> Choices:
    scenario = load_scenario("walk_flat")
    return Choices(scenario, control_texts(scenario, ("kinematic",)), {})


class Running:
    """A server in a thread."""

    def __init__(self) -> None:
        self.server = LiveServer(choices(), None)
        ready = threading.Event()
        self._thread = threading.Thread(target=self.server.run, args=(lambda url: ready.set(),))
        self._thread.start()
        assert ready.wait(PATIENCE)
        _, _, host, self.token, _ = self.server.url.split("/")
        self.port = int(host.partition(":")[2])

    def get(self, path: str, **headers: str) -> tuple[int, str, dict[str, str]]:
        """Returns code, text and headers of a page."""
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


def until(opened: Any, holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """Returns the first message for which a condition holds."""
    while True:
        message: dict[str, Any] = json.loads(opened.recv(PATIENCE))
        if holds(message):
            return message


def is_frame(message: dict[str, Any]) -> bool:
    return bool(message["type"] == "frame")


def closing(opened: Any) -> tuple[int, str]:
    """Reads until the server closes the connection; returns code and reason."""
    with pytest.raises(ConnectionClosed) as caught:
        until(opened, lambda message: False)
    assert caught.value.rcvd is not None
    return caught.value.rcvd.code, caught.value.rcvd.reason


def test_the_page_is_one_file_that_may_load_nothing_else(running: Running) -> None:
    code, text, headers = running.get(f"/{running.token}/")
    assert code == 200
    assert "hexapod" in text
    assert "connect-src 'self';" in headers["content-security-policy"]
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["cache-control"] == "no-store"
    assert 'src="http' not in text


def test_the_server_listens_on_the_loopback_address_alone(running: Running) -> None:
    assert running.server.url.startswith("http://127.0.0.1:")
    assert len(running.token) >= 20


def test_another_token_host_or_origin_is_refused(running: Running) -> None:
    page = f"/{running.token}/"
    for path in ("/", "/wrong/", f"/{running.token[:-1]}/", "/wrong"):
        assert running.get(path)[0] == 403
    for host in ("robot.example.org", f"robot.example.org:{running.port}"):
        assert running.get(page, host=host)[0] == 403
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


def test_two_pages_see_one_robot_and_the_last_command_wins(running: Running) -> None:
    with running.socket() as one, running.socket() as two:
        one.send(json.dumps({"type": "drive", "forward": 1, "speed": 0.5}))
        until(two, lambda m: is_frame(m) and m["command"][0] > 0)
        two.send(json.dumps({"type": "drive", "turn": 1}))
        frame = until(one, lambda m: is_frame(m) and m["command"][2] > 0)
        assert frame["command"][0] == 0.0


def test_a_page_that_is_closed_while_it_drives_stops_the_robot(running: Running) -> None:
    with running.socket() as stays:
        with running.socket() as closed:
            closed.send(json.dumps({"type": "drive", "forward": 1, "speed": 0.5}))
            until(stays, lambda m: is_frame(m) and m["command"][0] > 0)
            closed.socket.shutdown(socket.SHUT_RDWR)  # as a browser that is killed: no farewell
        until(stays, lambda m: is_frame(m) and m["command"][0] == 0)


def test_what_is_recorded_can_be_fetched(running: Running) -> None:
    with running.socket() as opened:
        opened.send(json.dumps({"type": "do", "action": "record"}))
        until(opened, lambda m: m["type"] == "status" and m["recording"])
        until(opened, lambda m: is_frame(m) and m["time"] > 0.1)
        opened.send(json.dumps({"type": "do", "action": "stop"}))
        until(opened, lambda m: m["type"] == "status" and m["recorded"])
    code, text, headers = running.get(f"/{running.token}/scenario.toml")
    assert code == 200
    assert 'title = "Walk on flat ground, driven by hand"' in text
    assert headers["content-disposition"] == 'attachment; filename="driven.toml"'


@pytest.mark.parametrize(
    ("text", "code"),
    [("nonsense", 1008), ("x" * 10_000, 1009)],  # the second is too large
)
def test_a_page_that_misbehaves_is_closed_and_another_one_goes_on(
    running: Running, text: str, code: int
) -> None:
    with running.socket() as calm, running.socket() as bad:
        with suppress(ConnectionClosed):
            bad.send(text)
        assert closing(bad)[0] == code
        time = until(calm, is_frame)["time"]
        assert until(calm, lambda m: is_frame(m) and m["time"] > time + 0.1)


def test_a_page_too_many_is_refused(running: Running) -> None:
    while running.server.pages:  # those of the tests before
        threading.Event().wait(0.01)
    with ExitStack() as stack:
        for _ in range(MOST_PAGES):
            until(stack.enter_context(running.socket()), is_frame)
        one_more = stack.enter_context(running.socket())
        assert closing(one_more) == (1013, "too many pages")


def test_a_loop_that_ends_by_itself_ends_the_server() -> None:
    running = Running()
    running.server._loop.ended = True
    running._thread.join(PATIENCE)
    assert not running._thread.is_alive()


def test_a_port_that_is_taken_is_refused(running: Running) -> None:
    with pytest.raises(LiveError, match="cannot listen on this port"):
        LiveServer(choices(), None, port=running.port)


def test_a_page_that_reads_nothing_waits_for_the_newest_state_alone() -> None:
    sent = list[str]()

    async def send(text: str) -> None:
        sent.append(text)

    async def read() -> None:
        page = Page({"world": "the world"})
        for number in range(1000):
            page.offer("frame", str(number))
        with suppress(TimeoutError):
            await asyncio.wait_for(page.send_all(send), 0.05)

    asyncio.run(read())
    assert sent == ["the world", "999"]


def test_a_page_that_joins_later_gets_no_old_notes(running: Running) -> None:
    with running.socket() as first:
        first.send(json.dumps({"type": "leg", "leg": 0}))
        until(first, lambda m: m["type"] == "note")
        with running.socket() as later:
            kinds = [json.loads(later.recv(PATIENCE))["type"] for _ in range(6)]
        first.send(json.dumps({"type": "leg", "leg": 0}))
        until(first, lambda m: m["type"] == "note")
    assert {"world", "status", "frame"} <= set(kinds)
    assert "note" not in kinds
