"""Drives the system's Chromium by Playwright, without a network, for tests of reports."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

# a missing browser is a failure, not a reason to skip
REQUIRED = os.environ.get("HEXAPOD_BROWSER", "") != ""
FULL = os.environ.get("HEXAPOD_BROWSER") == "full"  # the 60 s walk too
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# WebGL without a graphics card
FLAGS = (
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
)
PATIENCE = (
    120_000  # ms    for a loaded machine without a graphics card; nothing is asserted about it
)


def find_chromium() -> str:
    """Returns the path of a Chromium.

    Without one the test is skipped, or fails if HEXAPOD_BROWSER is set.
    """
    found = os.environ.get("HEXAPOD_CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        (pytest.fail if REQUIRED else pytest.skip)(
            "no Chromium: apt-get install chromium, or HEXAPOD_CHROMIUM=/path/to/it"
        )
    return str(found)


Launcher = Callable[..., Any]


@contextmanager
def launcher() -> Iterator[Launcher]:
    """Starts browsers with flags; Playwright runs once per thread."""
    from playwright.sync_api import sync_playwright  # noqa: PLC0415  only where there is a browser

    path = find_chromium()
    with sync_playwright() as playwright:
        yield lambda *flags: playwright.chromium.launch(executable_path=path, args=[*flags])


def watched(page: Any) -> tuple[list[str], list[str]]:
    """Returns two lists that fill with the errors and with the requests of a page."""
    errors: list[str] = []
    requests: list[str] = []
    page.on(
        "console", lambda message: errors.append(message.text) if message.type == "error" else None
    )
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("request", lambda request: requests.append(request.url))
    return errors, requests


class Opened:
    """A report in a browser page, with all its errors and requests."""

    def __init__(
        self,
        browser: Any,
        file: Path,
        *,
        address: str = "",
        size: tuple[int, int] = (1280, 900),
        **options: Any,
    ) -> None:
        viewport = {"width": size[0], "height": size[1]}
        self.context = browser.new_context(viewport=viewport, offline=True, **options)
        self.page = self.context.new_page()
        self.page.set_default_timeout(PATIENCE)
        self.errors, self.requests = watched(self.page)
        begin = time.perf_counter()
        self.page.goto(file.as_uri() + address)
        self.page.wait_for_selector("html[data-opened]", state="attached")
        self.opened = time.perf_counter() - begin  # s    text, tables, plots
        self.page.wait_for_selector("html[data-ready]", state="attached")
        self.ready = time.perf_counter() - begin  # s    the replay too

    def close(self) -> None:
        self.context.close()

    def value(self, expression: str) -> Any:
        """Returns the value of JavaScript in the page; `clock` is the replay's clock."""
        return self.page.evaluate(
            f"(() => {{ const clock = window.hexapod?.clock; return {expression}; }})()"
        )

    def wait(self, expression: str) -> None:
        """Waits until JavaScript in the page is true.

        Playwright's own function would need eval, which the page forbids.
        """
        self.until(lambda: bool(self.value(expression)), expression)

    def until(self, holds: Callable[[], bool], what: str = "the condition") -> None:
        """Waits until a condition holds: the page draws some frames after an event."""
        end = time.monotonic() + PATIENCE / 1e3
        while not holds():
            assert time.monotonic() < end, f"never true: {what}"
            self.page.wait_for_timeout(50)

    def seek(self, seconds: float) -> None:
        """Stops the replay at a time and waits until it is drawn."""
        self.page.evaluate(
            "time => { window.hexapod.clock.pause(); window.hexapod.clock.seek(time); }", seconds
        )
        self.page.evaluate(
            "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
        )

    def playheads(self) -> list[float]:
        """Returns the position of the cursor in each plot in pixels; -1 where it is outside."""
        return list(
            self.page.eval_on_selector_all(
                ".playhead",
                "all => all.map(e => e.style.display === 'none' ? -1 : "
                "e.getBoundingClientRect().left - e.parentElement.getBoundingClientRect().left)",
            )
        )
