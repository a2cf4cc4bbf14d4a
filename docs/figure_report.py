"""Makes docs/images/report.png, the README's picture, from a comparison's report as a browser shows
it.

hexapod compare demo_course -o out/demo && python docs/figure_report.py out/demo

Needs Playwright for Python (`pip install -e .[test]` brings it) and a Chromium (HEXAPOD_CHROMIUM
names one that is not in the path).
"""

from __future__ import annotations

import io
import os
import shutil
import sys
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

TIME = 18.0  # s    both robots walk in rubble
SIZE = {"width": 1280, "height": 1200}  # px
FLAGS = [
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]  # WebGL without a graphics card
COLOURS = 256  # of the picture's palette
PATIENCE = 120_000  # ms


def main() -> None:
    """Writes the picture."""
    report = Path(sys.argv[1]).resolve() / "report.html"
    chromium = (
        os.environ.get("HEXAPOD_CHROMIUM")
        or shutil.which("chromium")
        or sys.exit("no Chromium: apt-get install chromium")
    )
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        page = browser.new_page(viewport=SIZE, device_scale_factor=1.25, color_scheme="light")
        page.goto(f"{report.as_uri()}#t={TIME}")
        page.wait_for_selector("html[data-ready]", state="attached", timeout=PATIENCE)
        page.wait_for_timeout(500)  # ms    until the first picture is on the screen
        picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
        browser.close()
    target = Path(__file__).parent / "images" / "report.png"
    picture.quantize(COLOURS, dither=Image.Dither.NONE).save(target, optimize=True)
    print(f"wrote {target}: {target.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
