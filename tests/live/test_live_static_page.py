"""The page with the robot inside, opened from the disk: it walks without a server."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from browser import FLAGS, PATIENCE, launcher
from command import Call, assert_refused

from hexapod_cosim.extensions.live.static_page import write_static_page

FRAME = "window.hexapod.shown.frame"


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_static_page(tmp_path_factory.mktemp("page") / "walk.html")


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with launcher() as launch:
        yield launch(*FLAGS)


def opened(browser: Any, written: Path, **options: Any) -> Any:
    """Returns the page from the disk, without a network; `problems` are errors and requests."""
    found = browser.new_context(offline=True, **options).new_page()
    found.set_default_timeout(PATIENCE)
    found.problems = []
    found.on("pageerror", lambda error: found.problems.append(str(error)))
    found.on("request", lambda request: found.problems.append(request.url))
    found.goto(written.as_uri())
    found.wait_for_function(f"window.hexapod && {FRAME}")
    return found


@pytest.fixture(scope="module")
def page(browser: Any, written: Path) -> Any:
    """Of few pixels, because they are drawn without a graphics card."""
    small = {"width": 640, "height": 400}
    return opened(browser, written, viewport=small, device_scale_factor=0.5)


@contextmanager
def walking(page: Any) -> Iterator[None]:
    """Holds the key W; before and after it the command is 0, so that no frame of it is left."""
    page.wait_for_function(f"{FRAME}.command[0] === 0")
    page.keyboard.down("w")
    page.wait_for_function(f"{FRAME}.command[0] > 0")
    yield
    page.keyboard.up("w")
    page.wait_for_function(f"{FRAME}.command[0] === 0")


def watch_slowest(page: Any) -> None:
    """Keeps the least commanded speed [m/s] of the frames from now on in window.slowest."""
    page.evaluate(
        "window.slowest = 1; window.hexapod.link.on('frame', (frame) => {"
        "window.slowest = Math.min(window.slowest, frame.command[0]) })"
    )


def problems(page: Any) -> list[str]:
    return [text for text in page.problems if not text.startswith("file:")]


def test_the_page_is_one_file_of_at_most_2_mb(written: Path) -> None:
    assert written.stat().st_size < 2e6


@pytest.mark.parametrize(
    "words", [["stairs"], ["--control", "kinematic"], ["--set", "gait.period=0.8"], ["--port", "1"]]
)
def test_what_has_no_effect_on_the_page_is_refused(
    call: Call, tmp_path: Path, words: list[str]
) -> None:
    page = tmp_path / "walk.html"
    assert_refused(
        call("live", "--page", page, *words), "do nothing for the page", "leave them out"
    )
    assert not page.exists()


PHONE = {
    "viewport": {"width": 390, "height": 844},
    "has_touch": True,
    "is_mobile": True,
    "device_scale_factor": 0.5,  # fewer pixels, because they are drawn without a graphics card
    "color_scheme": "dark",
}


@pytest.fixture(scope="module")
def phone(browser: Any, written: Path) -> Any:
    return opened(browser, written, **PHONE)


def test_on_a_phone_all_fits_its_width_and_a_button_walks_the_robot(phone: Any) -> None:
    assert phone.evaluate("document.documentElement.scrollWidth") == 390
    for name in ("controls", "gaits", "friction"):
        box = phone.locator(f"#{name}").bounding_box()
        assert box["x"] >= 0.0
        assert box["x"] + box["width"] <= 390.0
    colour = phone.evaluate("getComputedStyle(document.body).backgroundColor")
    brightness = sum(int(part) for part in re.findall(r"\d+", colour)[:3]) / 3
    assert brightness < 60
    phone.evaluate("scrollTo(0, 0)")
    phone.locator("[data-key=KeyW]").hover()
    phone.mouse.down()
    phone.wait_for_function(f"{FRAME}.position[0] > 0.02")
    phone.mouse.up()
    phone.wait_for_function(f"{FRAME}.command[0] === 0")
    assert problems(phone) == []


def test_on_a_phone_on_its_side_the_robot_stands_beside_the_pad(phone: Any) -> None:
    phone.set_viewport_size({"width": 740, "height": 360})
    assert phone.evaluate("document.documentElement.scrollWidth") == 740
    stage, pad = (phone.locator(name).bounding_box() for name in ("#stage", ".pad"))
    assert stage["x"] + stage["width"] <= pad["x"]
    assert max(box["y"] + box["height"] for box in (stage, pad)) <= 360.0
    # what the controls are, and which one walks, is there from the start
    assert phone.inner_text("#control-about").startswith("Plays the planned joint angles")
    assert phone.inner_text("#controls [aria-pressed=true]") == "kinematic"
    phone.context.close()  # it is not drawn beside the page of the next tests


def test_the_robot_walks_and_turns_by_keys_without_a_network(page: Any) -> None:
    with walking(page):
        page.wait_for_function(f"{FRAME}.position[0] > 0.03")
        page.keyboard.down("a")
        page.wait_for_function(f"{FRAME}.quaternion[3] > 0.03")
        page.keyboard.up("a")
    assert problems(page) == []


def test_the_gait_changes_while_the_robot_walks(page: Any) -> None:
    with walking(page):
        fast = page.evaluate(f"{FRAME}.command[0]")
        watch_slowest(page)
        page.click("#gaits [data-value=ripple]")
        page.wait_for_selector("#gaits [data-value=ripple][aria-pressed=true]")
        # each leg has stepped
        page.wait_for_function(f"{FRAME}.command[0] > 1.5 * window.slowest")
        # 0.3 of the ripple's limit of 0.193 m/s, at the speed with which the page begins
        assert 0.0 < page.evaluate("window.slowest") < 0.3 * fast


def test_the_control_changes_while_the_robot_walks(page: Any) -> None:
    with walking(page):
        watch_slowest(page)
        for control in ("compliant", "paper", "kinematic"):
            page.click(f"#controls [data-value={control}]")
            page.wait_for_selector(f"#controls [data-value={control}][aria-pressed=true]")
            begin = page.evaluate(f"{FRAME}.position[0]")
            page.wait_for_function(f"{FRAME}.position[0] > {begin} + 0.02")
        assert page.evaluate("window.slowest") > 0.0  # the command has held all the time
    assert problems(page) == []


def test_control_friction_and_place_answer(page: Any) -> None:
    page.click("#controls [data-value=paper]")
    page.wait_for_selector("#controls [data-value=paper][aria-pressed=true]")
    page.fill("#friction", "0.3")
    page.dispatch_event("#friction", "change")
    page.wait_for_function("document.getElementById('friction-value').textContent === '0.30'")
    placed = page.evaluate(f"{FRAME}.placed")
    page.click("[data-do=place]")
    page.wait_for_function(f"{FRAME}.placed > {placed}")
    assert page.evaluate(f"Math.abs({FRAME}.position[0])") < 0.05
    assert page.is_hidden("[data-do=record]")


def test_an_error_of_any_kind_is_shown_as_the_fault_and_ends_with_a_new_start(page: Any) -> None:
    page.evaluate(
        "() => { window.hexapod.link.do = () => { throw new RangeError('no memory left') } }"
    )
    page.wait_for_selector("#fault:not([hidden])")
    assert page.inner_text("#fault-text") == "RangeError: no memory left"
    assert page.inner_text("#fault-title").startswith("The plant has stopped.")
    page.evaluate("delete window.hexapod.link.do")
    page.click("[data-do=place]")
    page.wait_for_selector("#fault", state="hidden")
    page.wait_for_function(f"{FRAME}.time > 0.2")
    assert problems(page) == []
