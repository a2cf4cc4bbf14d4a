"""The report in a real browser, opened from disk without a network.

HEXAPOD_BROWSER=full adds a walk of a minute.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import FLAGS, FULL, Launcher, Opened, find_chromium, launcher

from hexapod_cosim.cosim.cli import main
from hexapod_cosim.cosim.results.folder import read_result
from hexapod_cosim.cosim.results.window import robot_weight
from hexapod_cosim.models import LEG_NAMES, load_robot
from hexapod_cosim.models.kinematics import foot_positions, rotation_matrix

DURATION = 60.0 if FULL else 3.0  # s
LARGEST = 8e6  # bytes of a report of a minute's walk
PACKED = 2e-4  # m    a foot's place, from a position and angles in steps of 1/65535 of their ranges
# body weights    forces in steps of 1/65535 of their ranges, the hardest landing's included
PACKED_FORCE = 1e-3
LEAST_FORCE = 0.01  # body weights that have an arrow
# forces, slip, height and attitude, torques, feet against their plan
PLOTS = 6 + 7 + 4 + 3 + 6
SMALLEST_TEXT = 11  # px
TALLEST_BAR = 90  # px    on a phone
BRIGHT, DIM = 200, 60  # of 255


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs a comparison and returns its folder."""
    find_chromium()
    path = tmp_path_factory.mktemp("browser") / "compare"
    assert (
        main(
            [
                "compare",
                "walk_flat",
                *("--control", "kinematic", "--control", "compliant"),
                "--seeds",
                "1",
                "--set",
                f"duration={DURATION}",
                "-o",
                str(path),
            ]
        )
        == 0
    )
    return path


@pytest.fixture(scope="module")
def chromium() -> Iterator[Launcher]:
    with launcher() as launch:
        yield launch


@pytest.fixture(scope="module")
def browser(chromium: Launcher) -> Any:
    return chromium(*FLAGS)


@pytest.fixture(scope="module")
def report(folder: Path, browser: Any) -> Iterator[Opened]:
    """Opens the report of a comparison once, at 1 s."""
    page = Opened(browser, folder / "report.html", address="#t=1")
    yield page
    page.close()


def test_a_report_opens_from_disk_without_errors_and_asks_for_nothing_else(
    report: Opened, folder: Path
) -> None:
    size = (folder / "report.html").stat().st_size
    print(
        f"\n{DURATION:g} s walk: {size / 1e6:.2f} MB, "
        f"plots after {report.opened:.2f} s, replay after {report.ready:.2f} s"
    )
    assert report.errors == []
    assert [url.partition("#")[0] for url in report.requests] == [(folder / "report.html").as_uri()]
    assert size < LARGEST * max(DURATION / 60.0, 0.25)
    assert len(report.playheads()) == PLOTS


@pytest.mark.parametrize("control", ["kinematic", "compliant"])
def test_the_viewers_feet_stand_where_the_plants_do(
    report: Opened, folder: Path, control: str
) -> None:
    recording, robot = read_result(folder / control).view.recording, load_robot("athena")
    for row in (0, 137, len(recording.time) - 1):
        report.seek(float(recording.time[row]))
        feet = np.array(report.value(f"window.hexapod.feet('{control}')"))
        soles = recording.foot_vectors("position")[row]
        np.testing.assert_allclose(feet - [0.0, 0.0, robot.foot.radius], soles, atol=PACKED)
        turn = rotation_matrix(recording.vector("torso.quaternion", 4)[row])
        origin = recording.vector("torso.position")[row] - turn @ np.array(robot.torso.com)
        np.testing.assert_allclose(
            feet,
            origin + foot_positions(robot, recording.joints("angle")[row]) @ turn.T,
            atol=PACKED,
        )


def test_the_robots_move(report: Opened) -> None:
    pictures, places = [], []
    for time in (0.5, 1.25):
        report.seek(time)
        pictures.append(report.page.locator("#stage canvas").screenshot())
        places.append(
            report.value("['kinematic', 'compliant'].map(label => window.hexapod.feet(label))")
        )
    assert pictures[0] != pictures[1]
    # m    both of them
    assert np.abs(np.subtract(places[1], places[0])).max(axis=(1, 2)).min() > 0.005


def test_arrows_show_the_recorded_forces(report: Opened, folder: Path) -> None:
    run = read_result(folder / "compliant")
    recording = run.view.recording
    forces = recording.foot_vectors("force") / robot_weight(run.view.parameters)
    arrows = set()
    for row in range(0, len(recording.time) - 1, len(recording.time) // 7):
        share = 0.25  # of the way to the next row, so that rounding does not choose the row
        report.seek(float((1.0 - share) * recording.time[row] + share * recording.time[row + 1]))
        shown = report.value("window.hexapod.shown('compliant').arrows")
        between = (1.0 - share) * forces[row] + share * forces[row + 1]
        for arrow, force in zip(shown, between, strict=True):
            if arrow or np.linalg.norm(force) > LEAST_FORCE + PACKED_FORCE:
                np.testing.assert_allclose(arrow, force, atol=PACKED_FORCE)
            arrows.add(bool(arrow))
    assert arrows == {True, False}  # stepping feet are among them, and standing ones


@pytest.mark.parametrize("control", ["kinematic", "compliant"])
def test_discs_and_trails_are_those_of_the_time(report: Opened, folder: Path, control: str) -> None:
    recording = read_result(folder / control).view.recording
    contact, pieces = recording.feet("contact") > 0.5, [0]
    for row in (20, 160, 300, len(contact) - 2):
        report.seek(float(recording.time[row]) + 1e-3)
        shown = report.value(f"window.hexapod.shown('{control}')")
        assert shown["discs"] == contact[0].sum() + (contact[1 : row + 1] & ~contact[:row]).sum()
        assert shown["pieces"] >= pieces[-1]
        pieces.append(shown["pieces"])
    assert control != "kinematic" or pieces[-1] > pieces[1]  # whose feet slip


def test_both_views_show_a_robot(report: Opened) -> None:
    report.seek(1.0)
    report.page.locator("#stage").scroll_into_view_if_needed()
    share = report.page.evaluate(COLOURFUL, report.page.locator("#stage canvas").screenshot().hex())
    assert min(share) > 0.01, f"share of each half that is neither ground nor sky: {share}"


# of each half of a picture, the share of pixels with a colour (the robots' blue and orange) rather
# than a grey
COLOURFUL = """async hex => {
  const bytes = Uint8Array.from(hex.match(/../g), pair => parseInt(pair, 16));
  const picture = await createImageBitmap(new Blob([bytes], {type: "image/png"}));
  const canvas = new OffscreenCanvas(picture.width, picture.height);
  const brush = canvas.getContext("2d");
  brush.drawImage(picture, 0, 0);
  const half = Math.floor(picture.width / 2);
  return [0, half].map(left => {
    const {data} = brush.getImageData(left, 0, half, picture.height);
    let count = 0;
    for (let k = 0; k < data.length; k += 4) {
      const colour = data.slice(k, k + 3);
      count += Math.max(...colour) - Math.min(...colour) > 40;
    }
    return count / (data.length / 4);
  });
}"""


def test_scrubbing_moves_the_cursor_of_every_plot(report: Opened) -> None:
    report.seek(0.2)
    report.page.locator("#time").scroll_into_view_if_needed()
    slider = report.page.locator("#time").bounding_box()
    for share in (0.3, 0.6):
        before = report.playheads()
        report.page.mouse.click(
            slider["x"] + share * slider["width"], slider["y"] + 0.5 * slider["height"]
        )
        aim = share * DURATION
        report.wait(f"Math.abs(clock.time - {aim}) < {0.05 * aim}")
        report.until(partial(moved, report, before), f"all cursors move to {aim} s")


def moved(report: Opened, before: list[float]) -> bool:
    """Returns whether the cursor of every plot is inside it and has moved by over a pixel."""
    after = report.playheads()
    return all(a >= 0.0 and abs(a - b) > 1.0 for a, b in zip(after, before, strict=True))


def test_pressing_in_a_plot_moves_the_replay(report: Opened) -> None:
    report.seek(0.1)
    plot = report.page.locator('[data-panels="posture"] .u-over').first
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    report.page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.7 * box["height"])
    report.wait("Math.abs(clock.time - 1.5) < 0.05")  # the middle of three cycles
    report.page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 5)
    report.page.mouse.down()
    report.page.mouse.move(box["x"] + 0.25 * box["width"], box["y"] + 5)
    report.page.mouse.up()
    report.wait("Math.abs(clock.time - 0.75) < 0.05")


def test_plots_show_as_many_cycles_as_asked(report: Opened) -> None:
    report.seek(1.0)
    report.page.get_by_role("button", name="1 cycle", exact=True).click()
    one = report.playheads()
    report.page.get_by_role("button", name="whole run").click()
    report.until(lambda: one != report.playheads(), "the cursors move")
    assert report.page.locator('#windows [aria-pressed="true"]').inner_text() == "whole run"
    report.page.locator("#windows button").nth(-2).click()


def test_playing_goes_on_and_stops_at_the_end(report: Opened) -> None:
    report.seek(DURATION - 0.5)
    report.page.get_by_role("button", name="Play", exact=True).click()
    report.wait(f"clock.time >= {DURATION} - 1e-6")
    report.wait("clock.playing === false")
    report.page.get_by_role("button", name="Play", exact=True).click()
    report.wait(f"clock.time < {DURATION} - 0.1")  # from the start again
    report.page.get_by_role("button", name="Pause", exact=True).click()
    assert report.value("clock.playing") is False


def test_the_keyboard_does_it_all(report: Opened) -> None:
    report.seek(1.0)
    report.page.locator("body").focus()
    press = report.page.keyboard.press
    for key, time in (
        ("ArrowRight", 1.02),
        ("Shift+ArrowRight", 1.52),
        ("ArrowLeft", 1.5),
        ("End", DURATION),
        ("Home", 0.0),
    ):
        press(key)
        assert report.value("clock.time") == pytest.approx(time, abs=1e-6), key
    press("Space")
    assert report.value("clock.playing") is True
    press("Space")
    assert report.value("clock.playing") is False
    press("+")
    assert report.value("clock.speed") == 2
    press("-")
    press("-")
    assert report.value("clock.speed") == 0.5
    press("+")
    press("?")
    assert report.page.locator("#help").is_visible()
    press("Escape")
    assert not report.page.locator("#help").is_visible()


def test_every_control_has_a_name(report: Opened) -> None:
    controls = report.page.locator("button, input, select, [role=group]")
    assert controls.count() > 8
    unnamed = (
        "all => all.filter(e => !(e.getAttribute('aria-label') || e.textContent.trim()))"
        ".map(e => e.outerHTML)"
    )
    assert controls.evaluate_all(unnamed) == []


def test_there_is_a_light_and_a_dark_theme(report: Opened) -> None:
    brightness = (
        "getComputedStyle(document.body).backgroundColor.match(/[0-9.]+/g).slice(0, 3)"
        ".reduce((a, b) => a + Number(b), 0) / 3"
    )
    report.seek(1.0)
    light = report.value(brightness), report.page.locator("#stage canvas").screenshot()
    report.page.keyboard.press("t")
    report.seek(1.0)
    dark = report.value(brightness), report.page.locator("#stage canvas").screenshot()
    report.page.keyboard.press("t")
    assert light[0] > BRIGHT
    assert dark[0] < DIM
    assert light[1] != dark[1]
    assert report.errors == []


def test_a_phone_shows_all_of_it_in_the_systems_theme(folder: Path, browser: Any) -> None:
    phone = Opened(
        browser,
        folder / "report.html",
        address="#t=1",
        size=(360, 740),
        color_scheme="dark",
        has_touch=True,
    )
    assert phone.value("document.documentElement.scrollWidth") == 360
    assert phone.value("document.getElementById('stage').dataset.layout") == "stacked"
    sizes = (
        "[...document.querySelectorAll('main *')]"
        ".filter(e => e.children.length === 0 && e.textContent.trim())"
        ".map(e => parseFloat(getComputedStyle(e).fontSize))"
    )
    assert min(phone.value(sizes)) >= SMALLEST_TEXT
    assert phone.value("getComputedStyle(document.body).colorScheme") == "dark"
    ends = (
        "[...document.querySelectorAll('tbody td.number')]"
        ".map(e => e.getBoundingClientRect().right)"
    )
    # both values, the change and its mark are visible without scrolling sideways
    assert max(phone.value(ends)) <= 360
    assert phone.value("document.querySelector('.bar').offsetHeight") <= TALLEST_BAR
    assert phone.errors == []
    phone.close()


def test_a_reader_who_wants_less_motion_gets_a_standing_picture(folder: Path, browser: Any) -> None:
    still = Opened(browser, folder / "report.html", reduced_motion="reduce")
    assert (still.value("clock.playing"), still.value("clock.time")) == (False, 0.0)
    still.close()
    moving = Opened(browser, folder / "report.html")
    moving.wait("clock.time > 0.1")
    moving.close()


@pytest.mark.usefixtures("undrawn")
def test_a_single_run_and_one_that_recorded_little_have_pages_too(
    folder: Path, browser: Any, tmp_path: Path
) -> None:
    chosen = "outputs.csv=['torso.*']"
    for name, settings in (
        ("whole", []),
        ("little", ["--set", chosen, "--set", "outputs.formats=['csv']"]),
    ):
        assert (
            main(
                [
                    "simulate",
                    "stand",
                    "--set",
                    "duration=0.5",
                    *settings,
                    "-o",
                    str(tmp_path / name),
                ]
            )
            == 0
        )
        if settings:
            assert main(["report", str(tmp_path / name)]) == 0
        page = Opened(browser, tmp_path / name / "report.html", address="#t=0.2")
        assert page.errors == []
        assert len(page.playheads()) > 3
        assert page.page.locator("#stage canvas").count() == (0 if settings else 1)
        page.close()


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(("name", "legend"), [("stairs", ""), ("sand", "soil")])
def test_blocks_and_smooth_ground_with_soil_are_drawn(
    browser: Any, tmp_path: Path, name: str, legend: str
) -> None:
    walk = ["simulate", name, "--control", "kinematic", "--set", "duration=0.5"]
    assert main([*walk, "-o", str(tmp_path)]) == 0
    page = Opened(browser, tmp_path / "report.html", address="#t=0.4", color_scheme="dark")
    assert page.errors == []
    assert page.value("window.hexapod.shown('kinematic').discs") >= 6
    assert legend in page.page.locator(".keys").inner_text()
    page.close()


def test_without_webgl_the_plots_remain(folder: Path, chromium: Launcher) -> None:
    page = Opened(
        chromium("--no-sandbox", "--disable-3d-apis"), folder / "report.html", address="#t=1"
    )
    assert "This browser has no WebGL" in page.page.locator("#stage").inner_text()
    assert len(page.playheads()) == PLOTS
    page.close()


def test_without_javascript_the_tables_remain(folder: Path, browser: Any) -> None:
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto((folder / "report.html").as_uri())
    assert page.get_by_text("slip_per_metre").is_visible()
    context.close()


def test_legs_have_the_names_of_the_models(report: Opened) -> None:
    titles = report.page.locator('[data-panels="foot_forces"] .panel-name').all_inner_texts()
    assert [title.split()[0] for title in titles] == list(LEG_NAMES)
