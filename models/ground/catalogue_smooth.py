"""Surfaces of the catalogue that are smooth."""

from __future__ import annotations

from dataclasses import replace

from hexapod_cosim.models.ground import rough
from hexapod_cosim.models.ground.entries import Entry
from hexapod_cosim.models.ground.parameters import (
    HORIZONTAL,
    RANDOM_TILE,
    SIZE,
    TILE,
    length,
    ratio,
    text,
)

SLOPE = ratio((0.0, 0.4), "rise over run", least=-2.0, most=2.0)
SOIL = text("dry_sand", "name of the soil everywhere")

SMOOTH_SURFACES: dict[str, Entry] = {
    "plane": Entry(
        "Inclined plane as a grid",
        rough.plane,
        {
            "size": SIZE,
            "horizontal_scale": HORIZONTAL,
            "slope_x": ratio(0.0, "rise along +x over run", least=-2.0, most=2.0),
            "slope_y": ratio(0.0, "rise along +y over run", least=-2.0, most=2.0),
        },
    ),
    "wave": Entry(
        "Sine waves along x and y",
        rough.wave,
        {
            **TILE,
            "amplitude": length((0.02, 0.15), "largest height"),
            "num_waves": ratio(4.0, "waves along an edge of the map", least=0.1, most=1000.0),
        },
    ),
    "random_uniform": Entry(
        "Smooth roughness from random heights",
        rough.random_uniform,
        {
            **RANDOM_TILE,
            "horizontal_scale": replace(HORIZONTAL, default=0.1),
            "max_height": length((0.01, 0.05), "largest height above and below 0"),
        },
    ),
    "pyramid_slope": Entry(
        "Slopes down to all sides", rough.pyramid_slope, {**TILE, "slope": SLOPE}
    ),
    "ramp": Entry(
        "Ramp up and down along +x",
        rough.ramp,
        {**TILE, "slope": SLOPE, "ramp_length": length(0.5, "run of the ramp")},
    ),
    "dune": Entry(
        "Dunes across x, steep on their far side",
        rough.dune,
        {
            **TILE,
            "dune_height": length((0.03, 0.2), "height of a crest"),
            "dune_length": length(1.2, "from crest to crest", least=0.1, zero=True),
        },
    ),
    "sand": Entry(
        "Level soil",
        rough.sand,
        {"size": SIZE, "horizontal_scale": HORIZONTAL, "soil": SOIL},
    ),
}

# tiles of a curriculum that are no surfaces of their own
SMOOTH_TILES: dict[str, Entry] = {
    "inverted_pyramid_slope": Entry(
        "Slopes up to all sides", rough.inverted_pyramid_slope, {**TILE, "slope": SLOPE}
    ),
    "rough_slope": Entry(
        "Slopes down to all sides with roughness",
        rough.rough_slope,
        {**SMOOTH_SURFACES["random_uniform"].parameters, "slope": SLOPE},
    ),
}
