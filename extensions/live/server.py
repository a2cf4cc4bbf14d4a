"""Serves the page of a live robot to browsers on this computer, and runs its loop.

The server listens on the loopback address alone. Every address begins with a random token. Requests
with another token, from another origin or for another host are refused, so that neither programs of
other users nor pages of other sites reach the robot.
"""

from __future__ import annotations

import asyncio
import secrets
import socket
import sys
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from errno import EADDRINUSE
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import HTTPConnection, Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket

from hexapod_cosim.controller import Gains
from hexapod_cosim.extensions.live.hub import Hub
from hexapod_cosim.extensions.live.loop import Loop
from hexapod_cosim.extensions.live.messages import MessageError, read_message
from hexapod_cosim.extensions.live.page import render_page
from hexapod_cosim.extensions.live.robot import LiveRobot
from hexapod_cosim.extensions.live.settings import Choices
from hexapod_cosim.models import HexapodError

HOST = "127.0.0.1"
TOKEN_BYTES = 16
POLICY = 1008  # WebSocket: closed because of what the page sent
BUSY = 1013  # WebSocket: try again later
ENDING = 5.0  # s    until a loop that does not end is left behind
SWITCH = 5e-4  # s    for which the server's thread may keep the loop's waiting
UVICORN: dict[str, Any] = {
    "ws": "websockets-sansio",
    "ws_max_size": 4096,
    "ws_max_queue": 16,
    "log_level": "critical",
    "access_log": False,
    "server_header": False,
    "proxy_headers": False,
    "timeout_graceful_shutdown": 1,
    "lifespan": "on",
}
HEADERS = {
    "cache-control": "no-store",
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


class Guard:
    """Refuses requests for another host, from another origin or without the token."""

    def __init__(self, app: Any, port: int, token: str) -> None:
        self._app, self._token = app, token.encode()
        self._hosts = {f"{name}:{port}" for name in (HOST, "localhost")}

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Answers what is refused, and passes on all else."""
        if scope["type"] == "lifespan" or self._allows(HTTPConnection(scope)):
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await WebSocket(scope, receive, send).close(POLICY)
        else:
            refusal = "use the address that `hexapod live` printed"
            await PlainTextResponse(refusal, 403, HEADERS)(scope, receive, send)

    def _allows(self, request: HTTPConnection) -> bool:
        host, origin = request.headers.get("host", ""), request.headers.get("origin")
        is_socket = request.scope["type"] == "websocket"  # of which browsers always say the origin
        ours = {f"http://{one}" for one in self._hosts} | (set() if is_socket else {None})
        token = request.url.path.split("/")[1].encode()
        # compared in a time that does not depend on how much of the token is right
        return host in self._hosts and origin in ours and secrets.compare_digest(token, self._token)


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
        port, token = self._socket.getsockname()[1], secrets.token_urlsafe(TOKEN_BYTES)
        self.url = f"http://{HOST}:{port}/{token}/"
        self._choices, self._gains = choices, gains
        self._page = render_page(choices)
        self.hub = Hub()
        self._loop: Loop
        self._events: asyncio.AbstractEventLoop | None = None
        routes = [
            Route("/{token}/", self._show),
            Route("/{token}/scenario.toml", self._save),
            WebSocketRoute("/{token}/socket", self._talk),
        ]
        guard = Middleware(Guard, port=port, token=token)
        app = Starlette(routes=routes, middleware=[guard], lifespan=self._lifespan)
        self._server = uvicorn.Server(uvicorn.Config(app, **UVICORN))

    def run(self, ready: Callable[[str], None] = lambda url: None) -> None:
        """Serves until Ctrl-C; `ready` gets the page's address.

        Raises HexapodError for a robot that cannot start.
        """
        sys.setswitchinterval(SWITCH)
        try:
            with LiveRobot(self._choices, gains=self._gains) as robot:
                self._loop = Loop(robot, self._publish)
                thread = threading.Thread(target=self._run_loop, daemon=True, name="hexapod-live")
                thread.start()
                try:
                    ready(self.url)
                    self._server.run(sockets=[self._socket])
                finally:
                    self._loop.ended = True
                    thread.join(ENDING)
        finally:
            self._socket.close()

    def _run_loop(self) -> None:
        """Runs the loop; when it ends by itself, the server ends too."""
        try:
            self._loop.run()
        finally:
            self.stop()

    def stop(self) -> None:
        """Ends `run`, from any thread."""
        self._server.should_exit = True

    def _publish(self, kind: str, content: Any) -> None:
        """Passes a message of the loop's thread to the pages."""
        if self._events is None:
            self.hub.publish(kind, content)  # kept for the first page
        else:
            with suppress(RuntimeError):  # the server has just ended
                self._events.call_soon_threadsafe(self.hub.publish, kind, content)

    @asynccontextmanager
    async def _lifespan(self, _app: Any) -> AsyncIterator[None]:
        self._events = asyncio.get_running_loop()
        yield

    async def _show(self, _request: Request) -> Response:
        return Response(self._page, headers=HEADERS, media_type="text/html")

    async def _save(self, _request: Request) -> Response:
        """Answers with the last recording as a scenario file."""
        if not self.hub.recording:
            return PlainTextResponse("nothing is recorded yet", 404, HEADERS)
        name = {"content-disposition": 'attachment; filename="driven.toml"'}
        return Response(self.hub.recording, headers=HEADERS | name, media_type="application/toml")

    async def _talk(self, connection: WebSocket) -> None:
        """Serves a page's socket until one side ends the connection."""
        await connection.accept()
        client = self.hub.join()
        if client is None:
            await connection.close(BUSY, "too many pages")
            return
        self._loop.pages = len(self.hub.clients)
        sending = asyncio.ensure_future(client.send_all(connection.send_text))
        try:
            while (message := await connection.receive())["type"] != "websocket.disconnect":
                self._loop.post(read_message(message.get("text") or message.get("bytes") or ""))
        except MessageError as error:
            await connection.close(POLICY, str(error)[:120])
        finally:
            self.hub.clients.discard(client)
            self._loop.pages = len(self.hub.clients)
            sending.cancel()
            with suppress(asyncio.CancelledError, Exception):
                await sending


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
