"""Makes docs/images/live.webp, the README's animated picture of a robot that is driven live.

python docs/live/figure.py

The loop's clock goes on from picture to picture, however long the browser takes to draw one. So the
figures of real time would say nothing, and are left out.

Needs what docs/figure_report.py needs.
"""

from __future__ import annotations

import io
import os
import shutil
import sys
import threading
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import sleep
from typing import Any

from PIL import Image
from playwright.sync_api import sync_playwright

from hexapod_cosim.cosim.run.plan import chosen_gains
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.extensions.live import server as live_server
from hexapod_cosim.extensions.live.loop import Loop
from hexapod_cosim.extensions.live.settings import Choices, control_texts

RATE = 12  # pictures per second of simulated time
STEP = 0.02  # s    by which the clock goes on: a state is sent as often
SECONDS = "window.hexapod.shown.frame.time"
SETTLE = 150  # ms
END = 7.0  # s    of simulated time
SIZE = {"width": 1280, "height": 800}  # px    of the browser
WIDTH = 800  # px    of the picture
QUALITY = 42  # of WebP
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
PATIENCE = 120_000  # ms
HIDDEN = ".pills, .notes, .hint { visibility: hidden } * { caret-color: transparent }"
# what is done from a simulated time [s] on
KEYS = {0.2: ("down", "w"), 2.2: ("down", "a"), 4.2: ("up", "a"), 6.0: ("up", "w")}
PUSH = (4.8, 5.6)  # s


@dataclass
class Clock:
    """A clock of the loop [s], which the thread of the pictures moves."""

    value: float = 0.0

    def pause(self, seconds: float) -> None:
        """Waits until the clock has moved on."""
        end = self.value + seconds
        while self.value < end - 1e-9:
            sleep(0.002)


@dataclass
class Driver:
    """Presses keys and drags the robot at their times."""

    page: Any
    pushing: bool = False

    def act(self, time: float) -> None:
        """Does what is due at a simulated time [s]."""
        for due in [due for due in KEYS if due <= time]:
            kind, key = KEYS.pop(due)
            getattr(self.page.keyboard, kind)(key)
        box = self.page.locator("#stage canvas").bounding_box()
        x, y = box["x"] + 0.5 * box["width"], box["y"] + 0.48 * box["height"]
        wanted = PUSH[0] <= time < PUSH[1]
        if wanted and not self.pushing:
            self.page.mouse.move(x, y)
            self.page.mouse.down()
            self.page.mouse.move(x + 110, y + 30, steps=3)
        elif self.pushing and not wanted:
            self.page.mouse.up()
        elif wanted:
            self.page.mouse.move(x + 112, y + 30)
        self.pushing = wanted


def go_on(page: Any, clock: Any, until: float) -> None:
    """Moves the clock in small steps until the page has a state of a simulated time [s]."""
    seconds = page.evaluate(SECONDS)
    while seconds < until - 0.5 * STEP:
        before = seconds
        clock.value += STEP
        for _ in range(40):
            seconds = page.evaluate(SECONDS)
            if seconds > before:
                break
            page.wait_for_timeout(5)


def take_pictures(page: Any, clock: Any) -> list[Image.Image]:
    """Drives the robot and returns pictures at even simulated times."""
    driver, pictures = Driver(page), list[Image.Image]()
    begin = page.evaluate(SECONDS)
    for number in range(round(END * RATE)):
        due = number / RATE
        driver.act(due)
        page.wait_for_timeout(SETTLE)  # the page's messages arrive
        go_on(page, clock, begin + due + 1.0 / RATE)
        page.wait_for_timeout(SETTLE)
        shown = Image.open(io.BytesIO(page.screenshot(type="jpeg", quality=95))).convert("RGB")
        height = round(WIDTH * shown.height / shown.width)
        pictures.append(shown.resize((WIDTH, height), Image.Resampling.LANCZOS))
    return pictures


def main() -> None:
    """Writes the picture."""
    chromium = (
        os.environ.get("HEXAPOD_CHROMIUM")
        or shutil.which("chromium")
        or sys.exit("no Chromium: apt-get install chromium")
    )
    scenario = load_scenario("walk_flat", overrides=["control=compliant"])
    choices = Choices(scenario, control_texts(scenario), {})
    clock = Clock()
    live_server.Loop = partial(Loop, now=lambda: clock.value, pause=clock.pause)
    server = live_server.LiveServer(choices, chosen_gains(scenario))
    ready = threading.Event()
    thread = threading.Thread(target=server.run, args=(lambda url: ready.set(),), daemon=True)
    thread.start()
    if not ready.wait(PATIENCE / 1e3):
        sys.exit("the robot did not start")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        page = browser.new_page(viewport=SIZE, color_scheme="light")
        page.goto(server.url)
        page.add_style_tag(content=HIDDEN)
        page.wait_for_function("window.hexapod?.shown.frame", timeout=PATIENCE)
        page.set_default_timeout(PATIENCE)
        pictures = take_pictures(page, clock)
        browser.close()
    clock.value += 1.0  # lets the loop end
    server.stop()
    thread.join()
    target = Path(__file__).parents[1] / "images" / "live.webp"
    pictures[0].save(
        target, save_all=True, append_images=pictures[1:], duration=round(1000 / RATE), loop=0,
        quality=QUALITY, method=6,
    )  # fmt: skip
    print(f"wrote {target}: {target.stat().st_size / 1000:.0f} kB, {len(pictures)} pictures")


if __name__ == "__main__":
    main()
