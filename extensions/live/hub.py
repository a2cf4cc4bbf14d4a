"""Passes messages of the loop to the pages; a slow page gets fewer states, always the newest."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from typing import Any

MOST_CLIENTS = 8


class Client:
    """A connected page, and what it is to be sent: the newest of each kind."""

    def __init__(self) -> None:
        self._waiting: dict[str, str] = {}
        self._ready = asyncio.Event()

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


class Hub:
    """The pages of one robot, and the newest message of each kind for new ones."""

    def __init__(self) -> None:
        self.clients: set[Client] = set()
        self._kept: dict[str, str] = {}
        self.recording = ""  # the last one, as a scenario file

    def join(self) -> Client | None:
        """Returns a new page; None when there are too many already."""
        if len(self.clients) >= MOST_CLIENTS:
            return None
        client = Client()
        self.clients.add(client)
        for kind, text in self._kept.items():
            client.offer(kind, text)
        return client

    def publish(self, kind: str, content: Any) -> None:
        """Passes a message of the loop to all pages."""
        if kind == "recording":
            self.recording = content
            return
        text = json.dumps({"type": kind, **content}, separators=(",", ":"))
        if kind != "note":
            self._kept[kind] = text
        for client in self.clients:
            client.offer(kind, text)
