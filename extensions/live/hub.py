"""Passes messages between pages and the loop: bounded everywhere, the newest state wins.

Several pages may watch one robot. Each of them may drive; the last one that sent a drive does, and
all pages show which one it is. A page's messages are limited in rate; those above it are dropped
and counted, and a page that goes on is closed.
"""

from __future__ import annotations

import asyncio
import json
import threading
from collections import deque
from collections.abc import Callable
from multiprocessing.connection import Connection
from time import monotonic
from typing import Any, Protocol

from hexapod_cosim.extensions.live.protocol import (
    Action,
    Change,
    Drive,
    Ping,
    Push,
    read_message,
)
from hexapod_cosim.models import HexapodError

MOST_CLIENTS = 8
RATE, BURST = 100.0, 200.0  # messages per second and at once, of a page
ACTION_RATE, ACTION_BURST = 10.0, 20.0  # of settings and actions among them
# messages above the rate and messages that are not valid, after which a page is closed: so many
# at once, and the rates [1/s] at which they are forgotten
MOST_DROPPED, DROPPED_RATE = 2000, 20.0
MOST_REFUSED, REFUSED_RATE = 20, 0.1
MOST_ACTIONS = 64  # settings and actions that wait for the loop
FLOOD, NONSENSE = "too many messages", "too many messages were not valid"


class Bucket:
    """Allows `rate` events per second, and `burst` at once."""

    def __init__(self, rate: float, burst: float, now: Callable[[], float]) -> None:
        self._rate, self._burst, self._now = rate, burst, now
        self._left, self._last = burst, now()

    def allows(self) -> bool:
        """Whether an event may happen now; if so, it is counted."""
        now = self._now()
        self._left = min(self._left + (now - self._last) * self._rate, self._burst)
        self._last = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


class Client:
    """A connected page: what it is to be sent, the newest of each kind, and what it sent."""

    def __init__(self, number: int, now: Callable[[], float]) -> None:
        self.number = number
        self.dropped = 0  # messages, as long as the page is connected
        self._slots: dict[str, str] = {}
        self._ready = asyncio.Event()
        self.messages = Bucket(RATE, BURST, now)
        self.actions = Bucket(ACTION_RATE, ACTION_BURST, now)
        self.drops = Bucket(DROPPED_RATE, MOST_DROPPED, now)
        self.refusals = Bucket(REFUSED_RATE, MOST_REFUSED, now)

    def offer(self, kind: str, text: str) -> None:
        """Replaces what is to be sent of a kind."""
        self._slots[kind] = text
        self._ready.set()

    async def take(self) -> list[str]:
        """Waits until there is something to send, and returns it."""
        await self._ready.wait()
        self._ready.clear()
        texts, self._slots = list(self._slots.values()), {}
        return texts


class Poster(Protocol):
    """The way of messages to the loop."""

    def post(self, kind: str, client: int, content: Any) -> None:
        """Gives a message to the loop, without waiting."""


class Hub:
    """The pages of one robot."""

    def __init__(self, poster: Poster, *, now: Callable[[], float] = monotonic) -> None:
        self._poster, self._now = poster, now
        self.clients: dict[int, Client] = {}
        self._count = 0
        self._kept: dict[str, str] = {}  # the newest of each kind, for new pages
        self.take = ""  # the last recording, as a scenario file

    def join(self) -> Client | None:
        """Returns a new page; None when there are too many already."""
        if len(self.clients) >= MOST_CLIENTS:
            return None
        self._count += 1
        client = Client(self._count, self._now)
        self.clients[client.number] = client
        client.offer("hello", json.dumps({"type": "hello", "client": client.number}))
        for kind, text in self._kept.items():
            client.offer(kind, text)
        self._announce()
        return client

    def leave(self, client: Client) -> None:
        """Forgets a page; a second call does nothing."""
        if self.clients.pop(client.number, None) is not None:
            self._poster.post("left", client.number, None)
            self._announce()

    def _announce(self) -> None:
        """Tells the loop and all pages how many pages there are."""
        self._poster.post("clients", 0, len(self.clients))
        text = json.dumps({"type": "pages", "count": len(self.clients)})
        for client in self.clients.values():
            client.offer("pages", text)

    def from_loop(self, kind: str, content: Any) -> None:
        """Passes a message of the loop to all pages."""
        if kind == "frame":
            self._poster.post("taken", 0, 1)
        if kind == "take":
            self.take = content
            return
        text = json.dumps({"type": kind, **content}, separators=(",", ":"))
        self._kept[kind] = text
        for client in self.clients.values():
            client.offer(kind, text)

    def from_page(self, client: Client, text: str | bytes) -> str | None:
        """Passes a message of a page to the loop.

        Returns None, or the reason why the page is to be closed.
        """
        if not client.messages.allows():
            client.dropped += 1
            return None if client.drops.allows() else FLOOD
        try:
            message = read_message(text)
        except HexapodError as error:
            client.offer("refused", json.dumps({"type": "refused", "reason": str(error)}))
            return None if client.refusals.allows() else NONSENSE
        if isinstance(message, Change | Action) and not client.actions.allows():
            client.dropped += 1
            return None
        self._poster.post(_KINDS[type(message)], client.number, message)
        return None


_KINDS = {Drive: "drive", Push: "push", Ping: "ping", Change: "set", Action: "do"}
NEWEST = ("drive", "push", "ping", "clients")  # kinds of which the newest of a page is enough


class LoopLink:
    """The server's end of the connection with the loop: two threads that may wait for it.

    `receive` is called with kind and content of each message of the loop, in a thread; kind "lost"
    says that the loop has ended.
    """

    def __init__(self, connection: Connection, receive: Callable[[str, Any], None]) -> None:
        self._connection, self._receive = connection, receive
        self._condition = threading.Condition()
        self._newest: dict[tuple[str, int], Any] = {}
        self._actions: deque[tuple[str, int, Any]] = deque()
        self._taken = 0
        self._closed = False
        self._threads = [
            threading.Thread(target=target, daemon=True) for target in (self._read, self._write)
        ]

    def start(self) -> None:
        """Starts the threads."""
        for thread in self._threads:
            thread.start()

    def post(self, kind: str, client: int, content: Any) -> None:
        """Gives a message to the loop, without waiting; a newer one replaces one that waits."""
        with self._condition:
            if kind in NEWEST:
                self._newest[kind, client] = content
            elif kind == "taken":
                self._taken += content
            elif len(self._actions) < MOST_ACTIONS or kind in ("left", "end"):
                self._actions.append((kind, client, content))
            self._condition.notify()

    def close(self) -> None:
        """Asks the loop to end."""
        self.post("end", 0, None)

    def _read(self) -> None:
        try:
            while True:
                self._receive(*self._connection.recv())
        except (EOFError, OSError):
            with self._condition:
                self._closed = True
                self._condition.notify()
            self._receive("lost", None)

    def _write(self) -> None:
        while True:
            with self._condition:
                self._condition.wait_for(self._due)
                if self._closed:
                    return
                batch = [(kind, client, it) for (kind, client), it in self._newest.items()]
                batch += [*self._actions] + ([("taken", 0, self._taken)] if self._taken else [])
                self._newest, self._taken = {}, 0
                self._actions.clear()
            try:
                for message in batch:
                    self._connection.send(message)
            except (OSError, ValueError):
                return

    def _due(self) -> bool:
        return bool(self._closed or self._newest or self._actions or self._taken)
