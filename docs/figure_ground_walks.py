"""Makes the pictures of walks on uneven ground for docs/ground.md.

for ground in stairs rubble stones sand dune ramp course; do hexapod compare $ground --control \
    kinematic --control kinematic@chosen --control compliant@chosen -o out/terrains/$ground; done
python docs/figure_ground_walks.py out/terrains

Writes docs/images/ground_walks.png, the figure of the comparison, and
docs/images/ground_viewer.png, the replays as a browser shows them. Needs Playwright for Python
(`pip install -e .[test]` brings it) and a Chromium, as docs/figure_report.py does.
"""

from __future__ import annotations

import io
import os
import shutil
import sys
from pathlib import Path

import ground_figure
from PIL import Image
from playwright.sync_api import Browser, sync_playwright

IMAGES = Path(__file__).parent / "images"
# scenario -> time of the picture [s]
SHOWN = {"stairs": 9.0, "rubble": 8.0, "stones": 9.0, "dune": 10.0}
SHOWN |= {"sand": 9.0, "ramp": 8.0, "course": 42.0}
SIZE = {"width": 1200, "height": 780}  # px    of the browser; the text keeps its size
FLAGS = [
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]  # WebGL without a graphics card
COLOURS = 256  # of a picture's palette
GAP = 8  # px    between replays
PATIENCE = 120_000  # ms
NAMED = "(labels, name) => labels.forEach(label => label.prepend(`${name}, `))"


def main() -> None:
    """Writes the pictures."""
    folder = Path(sys.argv[1]).resolve()
    drawn = folder / "ground_walks.png"
    ground_figure.draw(folder, SHOWN, drawn)
    reduced(Image.open(drawn)).save(IMAGES / drawn.name, optimize=True)
    chromium = os.environ.get("HEXAPOD_CHROMIUM") or shutil.which("chromium")
    if chromium is None:
        sys.exit("no Chromium: apt-get install chromium, or HEXAPOD_CHROMIUM=/path/to/it")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        replays = [
            replay(browser, folder / name / "report.html", time, name)
            for name, time in SHOWN.items()
        ]
        browser.close()
    height = sum(picture.height + GAP for picture in replays) - GAP
    sheet = Image.new("RGB", (replays[0].width, height), "white")
    top = 0
    for picture in replays:
        sheet.paste(picture, (0, top))
        top += picture.height + GAP
    reduced(sheet).save(IMAGES / "ground_viewer.png", optimize=True)


def replay(browser: Browser, report: Path, time: float, name: str) -> Image.Image:
    """Returns the picture of a report's replay at a time [s], with the scenario's name in it."""
    page = browser.new_page(viewport=SIZE)  # type: ignore[arg-type]
    page.set_default_timeout(PATIENCE)
    page.goto(f"{report.as_uri()}#t={time}")
    page.wait_for_selector("html[data-ready]", state="attached")
    page.locator(".names b").evaluate_all(NAMED, name)
    page.locator(".keys").evaluate("keys => keys.remove()")
    page.wait_for_timeout(500)
    picture = Image.open(io.BytesIO(page.locator("#stage").screenshot())).convert("RGB")
    page.close()
    return picture


def reduced(picture: Image.Image) -> Image.Image:
    """Returns a picture with a palette, which is a third of the size.

    Without dithering, which makes plain surfaces rough and the file larger.
    """
    return picture.convert("RGB").quantize(
        COLOURS, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE
    )


if __name__ == "__main__":
    main()
