"""Serves the page of a live robot to browsers on this computer, and starts the loop.

The server listens on the loopback address alone. Every address begins with a random token. Requests
with another token, from another origin or for another host are refused, so that neither programs of
other users nor pages of other sites reach the robot.
"""

from __future__ import annotations

import asyncio
import secrets
import socket
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from errno import EADDRINUSE
from multiprocessing import get_context
from multiprocessing.connection import Connection
from types import MappingProxyType
from typing import Any

from hexapod_cosim.controller import Gains
from hexapod_cosim.extensions.live.hub import Client, Hub, LoopLink
from hexapod_cosim.extensions.live.loop import run_process
from hexapod_cosim.extensions.live.page import render_page
from hexapod_cosim.extensions.live.protocol import MOST_BYTES
from hexapod_cosim.extensions.live.settings import Choices
from hexapod_cosim.models import HexapodError

HOST = "127.0.0.1"
PORTS = 65536  # numbers of ports, from 0, which asks for a free one
NAMES = (HOST, "localhost")  # hosts that a browser may have asked for
TOKEN_BYTES = 16
POLICY = 1008  # WebSocket: closed because of what the page sent
BUSY = 1013  # WebSocket: try again later
ENDING = 5.0  # s    until a loop that does not end is killed
UVICORN: dict[str, Any] = {
    "ws": "websockets-sansio",
    "ws_max_size": 2 * MOST_BYTES,
    "ws_max_queue": 16,
    "log_level": "critical",
    "access_log": False,
    "server_header": False,
    "proxy_headers": False,
    "timeout_graceful_shutdown": 1,
    "lifespan": "on",
}
CSP = (
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; "
    "img-src data: blob:; connect-src 'self' ws://{host}:{port}; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'"
)
NONE: Mapping[str, str] = MappingProxyType({})
HEADERS = {
    "cache-control": "no-store",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
    "cross-origin-resource-policy": "same-origin",
}


class LiveError(HexapodError):
    """The live robot cannot be started, or its loop has ended by itself."""


@dataclass(frozen=True)
class Address:
    """The port and the token of the page's address."""

    port: int
    token: str

    @property
    def url(self) -> str:
        """The page's address."""
        return f"http://{HOST}:{self.port}/{self.token}/"

    def has(self, token: str) -> bool:
        """Whether a token is ours, in a time that does not tell how much of it is."""
        return secrets.compare_digest(token.encode(), self.token.encode())

    def is_ours(self, host: str, origin: str | None) -> bool:
        """Whether a request is for this host, and from no page but ours."""
        hosts = {f"{name}:{self.port}" for name in NAMES}
        return host in hosts and (origin is None or origin in {f"http://{one}" for one in hosts})


class Pages:
    """Answers requests for the page, for the last recording and for the socket."""

    def __init__(self, address: Address, hub: Hub, page: str) -> None:
        self._address, self._hub, self._page = address, hub, page

    async def show(self, request: Any) -> Any:
        """Answers with the page."""
        refused = self._refusal(request)
        if refused is not None:
            return refused
        host = request.headers["host"].rpartition(":")[0]
        policy = CSP.format(host=host, port=self._address.port)
        return _answer(self._page, kind="text/html", headers={"content-security-policy": policy})

    async def scenario(self, request: Any) -> Any:
        """Answers with the last recording as a scenario file."""
        refused = self._refusal(request)
        if refused is not None:
            return refused
        if not self._hub.take:
            return _answer("nothing is recorded yet", 404)
        name = {"content-disposition": 'attachment; filename="driven.toml"'}
        return _answer(self._hub.take, kind="application/toml", headers=name)

    def _refusal(self, request: Any) -> Any:
        """Returns the answer to a request that is refused; None for one that is not."""
        headers, token = request.headers, request.path_params["token"]
        if not self._address.is_ours(headers.get("host", ""), headers.get("origin")):
            return _answer("another host or origin is refused", 403)
        if not self._address.has(token):
            return _answer("this address lacks the token that `hexapod live` printed", 404)
        return None

    async def talk(self, connection: Any) -> None:
        """Serves a socket of our page; a socket of another one is refused."""
        headers, token = connection.headers, connection.path_params["token"]
        origin = headers.get("origin", "none")  # browsers always send one
        ours = self._address.is_ours(headers.get("host", ""), origin)
        if not ours or not self._address.has(token):
            await connection.close(POLICY)
            return
        await _serve_socket(connection, self._hub)


def _answer(
    text: str, code: int = 200, *, kind: str = "text/plain", headers: Mapping[str, str] = NONE
) -> Any:
    from starlette.responses import Response  # noqa: PLC0415  slow to import

    return Response(text, code, headers={**HEADERS, **headers}, media_type=kind)


def make_app(pages: Pages, on_start: Callable[[], None]) -> Any:
    """Returns the ASGI application; it calls `on_start` in its event loop."""
    from starlette.applications import Starlette  # noqa: PLC0415  slow to import
    from starlette.routing import Route, WebSocketRoute  # noqa: PLC0415

    @asynccontextmanager
    async def lifespan(_app: Any) -> AsyncIterator[None]:
        on_start()
        yield

    routes = [
        Route("/{token:str}/", pages.show),
        Route("/{token:str}/scenario.toml", pages.scenario),
        WebSocketRoute("/{token:str}/socket", pages.talk),
    ]
    app = Starlette(routes=routes, lifespan=lifespan)
    app.router.redirect_slashes = False  # a redirection would be answered before any check
    return app


async def _serve_socket(connection: Any, hub: Hub) -> None:
    """Serves a page until it or the server ends the connection."""
    await connection.accept()
    client = hub.join()
    if client is None:
        await connection.close(BUSY, "too many pages")
        return
    sending = asyncio.ensure_future(_send_all(connection, client))
    try:
        while True:
            message = await connection.receive()
            if message["type"] == "websocket.disconnect":
                return
            reason = hub.from_page(client, message.get("text") or message.get("bytes") or "")
            if reason is not None:
                await connection.close(POLICY, reason)
                return
    finally:
        hub.leave(client)
        sending.cancel()
        with suppress(asyncio.CancelledError, Exception):
            await sending


async def _send_all(connection: Any, client: Client) -> None:
    """Sends a page what is new; a slow page gets fewer states, and holds nothing up."""
    while True:
        for text in await client.take():
            await connection.send_text(text)


class LiveServer:
    """The server and the loop's process.

    Args:
        choices: the scenario and the changes that pages may make.
        gains: of the built-in controls.
        port: 0 for a free one.
        process: what the loop's process runs.

    Raises LiveError for a port that is taken.
    """

    def __init__(
        self,
        choices: Choices,
        gains: Gains | None,
        *,
        port: int = 0,
        process: Callable[[Connection, Choices, Gains | None], None] = run_process,
    ) -> None:
        self._socket = _bound(port)
        self.address = Address(self._socket.getsockname()[1], secrets.token_urlsafe(TOKEN_BYTES))
        context = get_context("spawn")
        ours, theirs = context.Pipe()
        self._process = context.Process(
            target=process, args=(theirs, choices, gains), name="hexapod-live", daemon=True
        )
        self._page = render_page(choices)
        self._link = LoopLink(ours, self._received)
        self.hub = Hub(self._link)
        self._server: Any = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self.lost: HexapodError | None = None  # why the loop has ended
        self._connection, self._theirs = ours, theirs

    def run(self, ready: Callable[[str], None] = lambda url: None) -> None:
        """Serves until Ctrl-C or until the loop ends; `ready` gets the page's address.

        Raises LiveError when the loop ends by itself.
        """
        import uvicorn  # noqa: PLC0415  slow to import

        app = make_app(Pages(self.address, self.hub, self._page), self._started)
        config = uvicorn.Config(app, **UVICORN)
        self._server = uvicorn.Server(config)
        try:
            self._start_loop()
            ready(self.address.url)
            self._server.run(sockets=[self._socket])
        finally:
            self._end()
        if self.lost is not None:
            raise self.lost

    def _start_loop(self) -> None:
        """Starts the loop's process and waits until it is ready. Raises HexapodError."""
        self._process.start()
        self._theirs.close()
        try:
            kind, content = self._connection.recv()
        except EOFError:
            kind, content = "refused", LiveError("the loop's process has ended by itself")
        if kind == "refused":
            raise content

    def _started(self) -> None:
        """Lets messages of the loop in, now that there is an event loop for them."""
        self._loop = asyncio.get_running_loop()
        self._link.start()

    def _received(self, kind: str, content: Any) -> None:
        """Takes a message of the loop, in the link's thread."""
        loop = self._loop
        if kind in ("lost", "refused"):
            if self._server is not None and not self._server.should_exit:
                ended = LiveError(
                    "the loop's process has ended by itself", fix="start `hexapod live` again"
                )
                self.lost = content if kind == "refused" else ended
                self._server.should_exit = True
            return
        if loop is not None and not loop.is_closed():
            with suppress(RuntimeError):  # the server has just ended
                loop.call_soon_threadsafe(self.hub.from_loop, kind, content)

    def stop(self) -> None:
        """Ends `run`, from any thread."""
        if self._server is not None:
            self._server.should_exit = True

    def _end(self) -> None:
        """Ends the loop's process."""
        self._link.close()
        if self._process.pid is not None:
            self._process.join(ENDING)
            if self._process.is_alive():
                self._process.kill()
                self._process.join()
        self._connection.close()
        self._socket.close()


def _bound(port: int) -> socket.socket:
    """Returns a socket that listens on a port of the loopback address. Raises LiveError."""
    bound = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        bound.bind((HOST, port))
        bound.listen()  # a browser that comes before the server is ready waits
    except (OSError, OverflowError) as error:
        bound.close()
        in_use = "another program uses it" if getattr(error, "errno", 0) == EADDRINUSE else None
        raise LiveError(
            "cannot listen on this port",
            got=port if in_use is None else f"{port}: {in_use}",
            expected=f"a free port from 1 to {PORTS - 1}",
            fix="leave out --port for a free one", where=HOST,
        ) from error  # fmt: skip
    return bound
