"""The page of a live robot in Chromium: it is driven by keys, buttons and drags.

Each test waits for what it tests; none waits for a time.
"""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from browser import FLAGS, PATIENCE, find_chromium, launcher, watched

COMMAND = [sys.executable, "-m", "hexapod_cosim.cosim.cli", "live", "walk_flat", "--no-browser"]


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """Starts `hexapod live` and returns the address that it prints."""
    find_chromium()
    process = subprocess.Popen(COMMAND, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    match = re.search(r"http://\S+", process.stdout.readline())
    assert match is not None
    try:
        yield match[0]
    finally:
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=PATIENCE / 1e3)
    assert (process.returncode, err) == (0, "")
    assert out.endswith("stopped\n")


class LivePage:
    """The live page in a browser, with all its errors and requests."""

    def __init__(self, browser: Any, address: str, **options: Any) -> None:
        # a quarter of the pixels, because they are drawn without a graphics card
        options = {"device_scale_factor": 0.5, **options}
        self.context = browser.new_context(**options)
        self.page = self.context.new_page()
        self.page.set_default_timeout(PATIENCE)
        self.errors, self.requests = watched(self.page)
        self.page.goto(address)
        self.until("window.hexapod?.view?.drawn > 0 && window.hexapod.shown.frame")

    def value(self, expression: str) -> Any:
        return self.page.evaluate(
            "expression => { const { shown, view } = window.hexapod ?? {};"
            f" const frame = shown?.frame; return ({expression}); }}",
            None,
        )

    def until(self, expression: str) -> None:
        """Waits until JavaScript in the page is true; `frame` is the newest frame."""
        end = time.monotonic() + PATIENCE / 1e3
        while time.monotonic() < end:
            if self.value(f"Boolean({expression})"):
                return
            self.page.wait_for_timeout(50)
        pytest.fail(f"never true: {expression}; the page says: {self.page.inner_text('#notes')!r}")

    def place(self) -> None:
        """Places the robot at its start."""
        placed = self.value("frame.placed")
        self.page.click("[data-do=place]")
        self.until(f"frame.placed > {placed} && frame.position[0] < 0.001")

    def close(self) -> None:
        self.context.close()


HEADING = "2 * Math.atan2(frame.quaternion[3], frame.quaternion[0])"  # rad    of an upright robot


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with launcher() as launch:
        yield launch(*FLAGS)


@pytest.fixture(scope="module")
def live(browser: Any, address: str) -> Iterator[LivePage]:
    page = LivePage(browser, address, viewport={"width": 1000, "height": 720})
    yield page
    page.close()


def test_on_a_phone_all_fits_its_width_and_a_button_turns_the_robot(
    browser: Any, address: str
) -> None:
    phone = LivePage(
        browser, address, viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True
    )
    assert phone.page.evaluate("document.documentElement.scrollWidth") <= 390
    phone.place()
    phone.page.evaluate("scrollTo(0, 0)")
    phone.page.locator("[data-key=KeyA]").hover()
    phone.page.mouse.down()
    phone.until(f"{HEADING} > 0.1")
    phone.page.mouse.up()
    phone.until("frame.command[2] === 0")
    assert phone.errors == []
    phone.close()


def test_the_page_opens_without_errors_and_asks_for_nothing_else(
    live: LivePage, address: str
) -> None:
    assert live.errors == []
    assert live.requests == [address]
    assert live.page.inner_text("#state") == "live"


def test_keys_walk_and_turn_the_robot(live: LivePage) -> None:
    live.place()
    live.page.keyboard.down("w")
    live.until("frame.position[0] > 0.03")
    assert live.page.locator("[data-key=KeyW].pressed").count() == 1
    live.page.keyboard.down("ArrowLeft")
    live.until(f"{HEADING} > 0.1")
    live.page.keyboard.up("w")
    live.page.keyboard.up("ArrowLeft")
    live.until("frame.command.every(part => part === 0)")
    live.page.keyboard.press("r")
    live.until("frame.command[3] > 0")
    live.page.keyboard.press("f")
    live.until("frame.command[3] === 0")


def test_a_key_that_is_held_when_the_window_loses_the_focus_is_let_go(live: LivePage) -> None:
    live.page.keyboard.down("s")
    live.until("frame.command[0] < 0")
    live.page.evaluate("window.dispatchEvent(new Event('blur'))")
    live.until("frame.command[0] === 0")
    live.page.keyboard.up("s")


def test_dragging_the_robot_pushes_it_and_letting_go_ends_the_push(live: LivePage) -> None:
    live.place()
    drawn = live.value("view.drawn")
    live.until(f"view.drawn > {drawn} + 2")  # the robot is drawn at its start
    box, spot = live.page.locator("#stage canvas").bounding_box(), live.value("view.spot")
    x, y = spot["x"], spot["y"]
    before = live.value("view.eye.controls.object.position.toArray()")
    live.page.mouse.move(x, y)
    live.page.mouse.down()
    live.page.mouse.move(x + 60, y, steps=3)
    live.until("Math.hypot(...frame.push) > 1")
    live.page.mouse.up()
    live.until("Math.hypot(...frame.push) === 0")
    # the view was not turned; a drag beside the robot turns it
    assert live.value("view.eye.controls.object.position.toArray()") == before
    live.page.mouse.move(box["x"] + 30, box["y"] + box["height"] - 60)
    live.page.mouse.down()
    live.page.mouse.move(box["x"] + 90, box["y"] + box["height"] - 60, steps=3)
    live.page.mouse.up()
    assert live.value("view.eye.controls.object.position.toArray()") != before
    live.page.click("#home")


LEG_PLACE = """() => {
  const { view } = window.hexapod, { width, height } = view.canvas.getBoundingClientRect();
  for (let y = 0; y < height; y += 4)
    for (let x = 0; x < width; x += 4)
      if (view.legAt({ clientX: x, clientY: y }) === 2) return [x, y];
}"""


def test_a_click_on_a_leg_makes_it_limp_and_another_one_healthy(live: LivePage) -> None:
    live.place()
    for words in ("Leg LR is limp.", "Leg LR works again."):
        live.page.mouse.click(*live.page.evaluate(LEG_PLACE))
        live.page.wait_for_selector(f"#notes p:has-text('{words}')")
    live.place()


def test_gait_control_friction_and_ground_are_changed(live: LivePage) -> None:
    live.page.click("#gaits [data-value=ripple]")
    live.page.wait_for_selector("#gaits [data-value=ripple][aria-pressed=true]")
    live.page.click("#controls [data-value=compliant]")
    live.page.wait_for_selector("#controls [data-value=compliant][aria-pressed=true]")
    live.page.locator("#friction").fill("0.4")
    live.until("document.getElementById('friction-value').textContent === '0.40'")
    placed = live.value("frame.placed")
    live.page.select_option("#ground", "stairs")
    live.until(f"frame.placed > {placed} && frame.time > 0.1")
    live.page.select_option("#ground", "scenario")
    live.until(f"frame.placed > {placed} + 1 && frame.time > 0.1")
    assert live.errors == []


def test_a_recording_is_saved(live: LivePage, tmp_path: Path) -> None:
    live.page.click("[data-do=record]")
    live.page.wait_for_selector("html[data-mode=recording]")
    live.page.keyboard.down("w")
    live.until("frame.time > 1 && frame.command[0] > 0")
    live.page.keyboard.up("w")
    live.until("frame.command[0] === 0")
    live.page.click("[data-do=record]")
    live.page.wait_for_selector("html[data-mode=free]")
    with live.page.expect_download() as download:
        live.page.click("#save")
    download.value.save_as(tmp_path / "driven.toml")
    text = (tmp_path / "driven.toml").read_text(encoding="utf-8")
    assert "driven by hand" in text
    assert text.count("[[command]]") >= 2


def test_both_themes_are_drawn(live: LivePage) -> None:
    colours = []
    for _ in range(2):
        live.page.keyboard.press("t")
        colours.append(live.page.evaluate("getComputedStyle(document.body).backgroundColor"))
    assert len(set(colours)) == 2
