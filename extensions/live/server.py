"""Serves the page of a live robot to browsers on this computer, and runs its loop.

The server listens on the loopback address alone. Every address begins with a random token. Requests
with another token, from another origin or for another host are refused, so that neither programs of
other users nor pages of other sites reach the robot. A slow page gets fewer states, always the
newest.
"""

from __future__ import annotations

import asyncio
import json
import logging
import secrets
import socket
import sys
import threading
from collections.abc import Awaitable, Callable
from contextlib import suppress
from errno import EADDRINUSE
from http import HTTPStatus
from typing import Any

from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers, MultipleValuesError
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from hexapod_cosim.controller import Gains
from hexapod_cosim.extensions.live.loop import Loop
from hexapod_cosim.extensions.live.messages import MessageError, read_message
from hexapod_cosim.extensions.live.page import render_page
from hexapod_cosim.extensions.live.robot import LiveRobot
from hexapod_cosim.extensions.live.settings import Choices
from hexapod_cosim.models import HexapodError

HOST = "127.0.0.1"
TOKEN_BYTES = 16
MOST_PAGES = 8
POLICY = 1008  # WebSocket: closed because of what the page sent
BUSY = 1013  # WebSocket: try again later
ENDING = 5.0  # s    until a loop that does not end is left behind
SWITCH = 5e-4  # s    for which the server's thread may keep the loop's waiting
SOCKET: dict[str, Any] = {
    "max_size": 4096,  # bytes of a message
    "compression": None,
    "close_timeout": 1,  # s
    "server_header": None,
    "logger": logging.Logger("hexapod-live", logging.CRITICAL + 1),  # says nothing
}
HEADERS = {
    "cache-control": "no-store",
    "connection": "close",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
    "cross-origin-resource-policy": "same-origin",
    "content-security-policy": (
        "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; "
        "img-src data: blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
        "frame-ancestors 'none'"
    ),
}


class LiveError(HexapodError):
    """The live robot cannot be started."""


class Page:
    """A connected page, and what it is to be sent: the newest message of each kind."""

    def __init__(self, waiting: dict[str, str]) -> None:
        self._waiting = waiting
        self._ready = asyncio.Event()
        self._ready.set()

    def offer(self, kind: str, text: str) -> None:
        """Replaces what is to be sent of a kind."""
        self._waiting[kind] = text
        self._ready.set()

    async def send_all(self, send: Callable[[str], Awaitable[None]]) -> None:
        """Sends what is offered, until it is cancelled."""
        while True:
            await self._ready.wait()
            self._ready.clear()
            texts, self._waiting = list(self._waiting.values()), {}
            for text in texts:
                await send(text)


class LiveServer:
    """The server and the thread of the loop.

    Args:
        choices: the scenario and the changes that pages may make.
        gains: of the built-in controls.
        port: 0 for a free one.

    Raises LiveError for a port that is taken.
    """

    def __init__(self, choices: Choices, gains: Gains | None, *, port: int = 0) -> None:
        self._socket = _bound(port)
        port, self._token = self._socket.getsockname()[1], secrets.token_urlsafe(TOKEN_BYTES)
        self.url = f"http://{HOST}:{port}/{self._token}/"
        self._hosts = {f"{name}:{port}" for name in (HOST, "localhost")}
        self._choices, self._gains = choices, gains
        self._html = render_page(choices)
        self.pages: set[Page] = set()
        self._newest: dict[str, str] = {}  # by kind, for new pages
        self._recording = ""  # the last one, as a scenario file
        self._loop: Loop
        self._events: asyncio.AbstractEventLoop
        self._end = asyncio.Event()

    def run(self, ready: Callable[[str], None] = lambda url: None) -> None:
        """Serves until Ctrl-C; `ready` gets the page's address.

        Raises HexapodError for a robot that cannot start.
        """
        sys.setswitchinterval(SWITCH)
        try:
            with LiveRobot(self._choices, gains=self._gains) as robot:
                self._loop = Loop(robot, self._publish)
                with asyncio.Runner() as runner:
                    self._events = runner.get_loop()
                    runner.run(self._serve(ready))
        finally:
            self._socket.close()

    async def _serve(self, ready: Callable[[str], None]) -> None:
        thread = threading.Thread(target=self._run_loop, daemon=True, name="hexapod-live")
        answer = self._answer
        async with serve(self._talk, sock=self._socket, process_request=answer, **SOCKET):
            thread.start()
            try:
                ready(self.url)
                await self._end.wait()
            finally:
                self._loop.ended = True
                thread.join(ENDING)

    def _run_loop(self) -> None:
        """Runs the loop; when it ends by itself, the server ends too."""
        try:
            self._loop.run()
        finally:
            self.stop()

    def stop(self) -> None:
        """Ends `run`, from any thread."""
        with suppress(RuntimeError):  # it has just ended
            self._events.call_soon_threadsafe(self._end.set)

    def _publish(self, kind: str, content: Any) -> None:
        """Passes a message of the loop's thread to the pages."""
        with suppress(RuntimeError):  # the server has just ended
            self._events.call_soon_threadsafe(self._offer, kind, content)

    def _offer(self, kind: str, content: Any) -> None:
        """Offers a message to all pages, and to new ones unless it is a note."""
        if kind == "recording":
            self._recording = content
            return
        text = json.dumps({"type": kind, **content}, separators=(",", ":"))
        if kind != "note":
            self._newest[kind] = text
        for page in self.pages:
            page.offer(kind, text)

    def _answer(self, _connection: ServerConnection, request: Request) -> Response | None:
        """Answers a request; returns None for that of a socket, which may be opened."""
        token, _, name = request.path[1:].partition("?")[0].partition("/")
        if not self._allows(request.headers, token, is_socket=name == "socket"):
            return _response(HTTPStatus.FORBIDDEN, "use the address that `hexapod live` printed")
        if name == "socket":
            return None
        if name == "":
            return _response(HTTPStatus.OK, self._html, kind="text/html")
        if name != "scenario.toml" or not self._recording:
            return _response(HTTPStatus.NOT_FOUND, "nothing is recorded yet")
        file = {"content-disposition": 'attachment; filename="driven.toml"'}
        return _response(HTTPStatus.OK, self._recording, kind="application/toml", more=file)

    def _allows(self, headers: Headers, token: str, *, is_socket: bool) -> bool:
        try:
            host, origin = headers.get("host", ""), headers.get("origin")
        except MultipleValuesError:
            return False
        # browsers always say the origin of a socket
        ours = {f"http://{one}" for one in self._hosts} | (set() if is_socket else {None})
        # compared in a time that does not depend on how much of the token is right
        right = secrets.compare_digest(token.encode(), self._token.encode())
        return host in self._hosts and origin in ours and right

    async def _talk(self, connection: ServerConnection) -> None:
        """Serves a page's socket until one side ends the connection."""
        if len(self.pages) >= MOST_PAGES:
            await connection.close(BUSY, "too many pages")
            return
        page = Page(dict(self._newest))
        self.pages.add(page)
        self._loop.pages = len(self.pages)
        sending = asyncio.ensure_future(page.send_all(connection.send))
        try:
            async for message in connection:
                self._loop.post(read_message(message))
        except MessageError as error:
            await connection.close(POLICY, error.what)
        except ConnectionClosed:
            pass
        finally:
            self.pages.discard(page)
            self._loop.pages = len(self.pages)
            sending.cancel()
            with suppress(asyncio.CancelledError, ConnectionClosed):
                await sending


def _response(
    status: HTTPStatus, body: str, *, kind: str = "text/plain", more: dict[str, str] | None = None
) -> Response:
    """Returns an HTTP response with a text."""
    content = body.encode()
    own = {"content-type": f"{kind}; charset=utf-8", "content-length": str(len(content))}
    headers = Headers({**HEADERS, **own, **(more or {})})
    return Response(status.value, status.phrase, headers, content)


def _bound(port: int) -> socket.socket:
    """Returns a socket that listens on a port of the loopback address. Raises LiveError."""
    bound = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        bound.bind((HOST, port))
        bound.listen()  # a browser that comes before the server is ready waits
    except (OSError, OverflowError) as error:
        bound.close()
        in_use = getattr(error, "errno", 0) == EADDRINUSE
        raise LiveError(
            "cannot listen on this port",
            got=f"{port}: another program uses it" if in_use else port,
            expected="a free port from 1 to 65535",
            fix="leave out --port for a free one", where=HOST,
        ) from error  # fmt: skip
    return bound
