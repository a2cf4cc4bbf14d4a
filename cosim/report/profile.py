"""The height profile of the ground along the torso's path, and its figure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hexapod_cosim.controller.figure_style import WIDTH
from hexapod_cosim.cosim.common.control_style import control_styles
from hexapod_cosim.cosim.master.recorder import ColumnError, Recording
from hexapod_cosim.cosim.results.ground import heights_at
from hexapod_cosim.cosim.results.window import View
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.ground.surface import Surface

SAMPLES = 600  # of the path, at most
GROUND = "0.35"  # grey of the ground


@dataclass(frozen=True)
class Profile:
    """The ground along the torso's path; `way` is the distance along the path [m]."""

    way: Array  # (samples,) m
    ground: Array  # (samples,) m    below the torso
    contact_way: Array  # (touch-downs,) m    of the contact points beside the path
    contact_height: Array  # (touch-downs,) m    world


def make_profile(view: View, surface: Surface) -> Profile:
    """Returns the profile of a run.

    A touch-down belongs to the nearest place of the path; those beyond its ends are left out.

    Raises ColumnError without the columns.
    """
    path = view.recording.vector("torso.position")[:, :2]
    path = path[np.unique(np.linspace(0, len(path) - 1, SAMPLES).astype(int))]
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
    contacts = _touch_downs(view.recording)
    distances = np.linalg.norm(contacts[:, None, :2] - path, axis=2)
    nearest = distances.argmin(axis=1)
    beside = (nearest > 0) & (nearest < len(path) - 1)
    return Profile(
        way=way,
        ground=heights_at(surface, view.parameters, *path.T),
        contact_way=way[nearest[beside]],
        contact_height=contacts[beside, 2],
    )


def _touch_downs(recording: Recording) -> Array:
    """Returns the contact points (n, 3) [m] of all touch-downs, leg by leg."""
    on = recording.feet("contact") > 0.5
    legs, rows = np.nonzero(np.diff(on.astype(int), axis=0, prepend=0).T > 0)
    return recording.foot_vectors("position")[rows, legs]


def profile(views: Mapping[str, View]) -> Figure:
    """Draws the ground along the torso's path of each run, and where its feet touched down.

    Raises ColumnError where no run was on a surface.
    """
    shown = {label: view for label, view in views.items() if view.surface is not None}
    if not shown:
        got, expected = f"runs of {', '.join(views)}", "a run whose terrain is a surface"
        raise ColumnError("no surface was recorded", got=got, expected=expected)
    figure, styles = Figure(figsize=(WIDTH, 0.4 + 1.8 * len(shown))), control_styles(views)
    axes = np.atleast_1d(figure.subplots(len(shown), 1, sharex=True, sharey=True))
    for axis, (label, view) in zip(axes, shown.items(), strict=True):
        assert view.surface is not None
        _draw(axis, label, make_profile(view, view.surface), styles[label].light)
    axes[-1].set_xlabel("way along the path [m]")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
    return figure


def _draw(axis: Axes, label: str, found: Profile, colour: str) -> None:
    axis.plot(found.way, 1e3 * found.ground, color=GROUND, linewidth=1.1, label="below the torso")
    dots: dict[str, Any] = {"marker": "o", "markersize": 2.6, "linestyle": "none"}
    heights = 1e3 * found.contact_height
    axis.plot(found.contact_way, heights, color=colour, label="feet touch down", **dots)
    axis.set_title(label)
    axis.set_ylabel("height [mm]")
    axis.margins(x=0.0)
