"""Makes the table and the pictures of walks on uneven ground for docs/ground.md.

hexapod compare stairs rubble stones sand dune ramp course --control kinematic \
    --control kinematic@chosen --control compliant@chosen -o out/terrains
python docs/figure_ground_walks.py out/terrains

Prints the table in Markdown, and writes docs/images/ground_walks.png, the figure of the table, and
docs/images/ground_viewer.png, the replays as a browser shows them. Needs Playwright for Python
(`pip install -e .[test]` brings it) and a Chromium, as docs/figure_report.py does.
"""

from __future__ import annotations

import csv
import io
import os
import shutil
import sys
from pathlib import Path

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
COLUMNS = {"walked": "walked", "slip": "slip [mm/m]", "peak": "peak [BW]"}
COLUMNS |= {"tilt": "tilt [deg]", "path": "path error [mm/m]"}


def main() -> None:
    """Prints the table and writes the pictures."""
    folder = Path(sys.argv[1]).resolve()
    print(table(folder / "terrains.csv"))
    reduced(Image.open(folder / "terrains.png")).save(IMAGES / "ground_walks.png", optimize=True)
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


def table(path: Path) -> str:
    """Returns the table of a comparison over scenarios in Markdown."""
    lines = [f"| scenario | control | {' | '.join(COLUMNS.values())} |", "|---" * 7 + "|"]
    with path.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            values = [_rounded(row[name]) for name in COLUMNS if name != "walked"]
            cells = [row["scenario"], row["control"], f"{row['walked']} of {row['runs']}", *values]
            lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _rounded(text: str) -> str:
    """Returns a number with three digits or more, - for none."""
    if not text:
        return "-"
    return f"{float(text):.0f}" if abs(float(text)) >= 1000.0 else f"{float(text):.3g}"


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
