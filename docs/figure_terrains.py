"""Makes docs/images/terrains.png, the reliefs of all surfaces of the catalogue.

python docs/figure_terrains.py
"""

from __future__ import annotations

import io
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure
from PIL import Image

from hexapod_cosim.controller.figure_style import DPI, SETTINGS
from hexapod_cosim.cosim.report.relief import draw_robot, draw_surface
from hexapod_cosim.models import load_robot
from hexapod_cosim.models.ground.table import CATALOGUE, make_surface

COLUMNS = 5
COLOURS = 256  # of the picture's palette


def main() -> None:
    """Writes the picture."""
    names = [name for name in CATALOGUE if name != "heightfield"]  # which needs a file
    rows, robot, content = -(-len(names) // COLUMNS), load_robot("athena"), io.BytesIO()
    with matplotlib.rc_context(SETTINGS | {"axes.grid": False, "axes.titlesize": 7.0}):
        figure = Figure(figsize=(1.8 * COLUMNS, 1.95 * rows))
        grid = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
        for axes in grid[len(names) :]:
            axes.set_axis_off()
        for axes, name in zip(grid, names, strict=False):
            surface = make_surface(name, {})
            draw_surface(axes, surface)
            draw_robot(axes, robot)
            low, high = 1e3 * surface.height.min(), 1e3 * surface.height.max()
            axes.set_title(f"{name}\n{low:.3g} to {high:.3g} mm")
            axes.tick_params(labelsize=5.0)
        figure.savefig(content, format="png", dpi=DPI)
    target = Path(__file__).parent / "images" / "terrains.png"
    picture = Image.open(content).convert("RGB")
    picture.quantize(COLOURS, dither=Image.Dither.NONE).save(target, optimize=True)
    print(f"wrote {target}: {target.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
