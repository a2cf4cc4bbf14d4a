"""Makes docs/images/terrains.png, the reliefs of all surfaces of the catalogue.

python docs/figure_terrains.py
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from hexapod_cosim.cosim.report.relief import contact_sheet
from hexapod_cosim.models import load_robot
from hexapod_cosim.models.ground.catalogue import CATALOGUE, make_surface

COLUMNS = 5
COLOURS = 256  # of the picture's palette


def main() -> None:
    """Writes the picture."""
    surfaces = [
        make_surface(name, {})
        for name in CATALOGUE
        if name != "heightfield"  # needs a file
    ]
    target = Path(__file__).parent / "images" / "terrains.png"
    with TemporaryDirectory() as folder:
        sheet = contact_sheet(
            surfaces, load_robot("athena"), Path(folder) / "sheet.png", columns=COLUMNS
        )
        picture = Image.open(sheet).convert("RGB")
    picture.quantize(COLOURS, dither=Image.Dither.NONE).save(target, optimize=True)
    print(f"wrote {target}: {target.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
