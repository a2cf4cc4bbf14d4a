"""Draws the loops of the paper's control: a Bode diagram, responses to shifts, and margins.

The diagram shows all eigenloci; margins are drawn over delay and over the shares.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from hexapod_cosim.controller.design.closed import disturbed, spectral_radius, splay
from hexapod_cosim.controller.design.loci import Response, critical_size, static_margin
from hexapod_cosim.controller.design.paper import (
    PaperLoops,
    Plants,
    closed_loop,
    scaled,
    shifted,
)
from hexapod_cosim.controller.design.standing import StandingPlant, weight_share
from hexapod_cosim.controller.figure_style import DPI, PALETTE, SETTINGS, UNDATED, WIDTH
from hexapod_cosim.controller.gains import Gains, GainsError
from hexapod_cosim.controller.plane import Array
from hexapod_cosim.models import Robot

STEP_TIME = 0.6  # s    shown of a response
SHIFT = 0.001  # m    of the feet
MOST_DELAY, DELAYS = 0.05, 21  # s    further delay shown, and in how many points
FACTORS = np.linspace(0.5, 3.5, 16)  # 1    on the shares
SMALLEST = 0.03  # 1    size of loci that are drawn
DECIBELS = (-40.0, 10.0)
COLOURS = {"worst": PALETTE[3], "others": "0.75", "asked": PALETTE[0], "without": PALETTE[1]}


def plot_design(robot: Robot, gains: Gains, plants: Plants, directory: str | Path) -> list[Path]:
    """Writes `bode`, `step` and `margins` as SVG and PNG; returns the paths.

    robot, plants: those that the gains were designed for. Raises GainsError for gains of another
    robot, or when the figures cannot be written.
    """
    if robot.hash != gains.robot_hash:
        fix = "pass the robot they were designed for"
        raise GainsError(
            "not the robot of these gains",
            got=robot.hash[:12],
            expected=gains.robot_hash[:12],
            fix=fix,
        )
    loops = PaperLoops(robot, plants, gains.requirements, period=gains.period)
    loci = np.concatenate([loops.loci(name, gains.paper) for name in plants])
    loci = loci[np.abs(loci).max(axis=1) > SMALLEST]
    from matplotlib import rc_context  # noqa: PLC0415  slow to import

    folder = Path(directory)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with rc_context(SETTINGS):
            figures = {
                "bode": _bode(loci, loops.omega, gains),
                "step": _step(loops, gains),
                "margins": _margins(loci, loops, gains),
            }
            return [
                path for name, figure in figures.items() for path in _save(figure, folder, name)
            ]
    except OSError as error:
        raise GainsError(
            "cannot write the design's figures",
            got=error.strerror,
            fix="choose a writable folder",
            where=str(folder),
        ) from error


def _figure(rows: int, columns: int, gains: Gains, **options: Any) -> tuple[Any, Any]:
    # a figure without pyplot: no global state, no display
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(WIDTH, 0.3 + 2.1 * rows))
    figure.suptitle(
        f"{gains.robot}, controller period {1e3 * gains.period:g} ms", fontsize="medium"
    )
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def _save(figure: Any, folder: Path, name: str) -> list[Path]:
    for kind, metadata in UNDATED.items():
        figure.savefig(folder / f"{name}.{kind}", dpi=DPI, metadata=metadata)
    return [folder / f"{name}.{kind}" for kind in UNDATED]


def _legend_below(figure: Any, *of: Any) -> None:
    """Draws one legend below the axes, with the labels of all of them."""
    found = {
        label: line
        for axes in of
        for line, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(list(found.values()), list(found), loc="outside lower center", ncols=len(found))


def _each(loci: Response, draw: Callable[..., Any]) -> None:
    """Draws all loci; the one that comes nearest to -1 is drawn last, on top."""
    worst = int(np.abs(1.0 + loci).min(axis=1).argmin())
    for k, locus in enumerate(loci):
        if k != worst:
            draw(locus, color=COLOURS["others"], lw=0.5, label="_")
    draw(loci[worst], color=COLOURS["worst"], lw=1.4, label="nearest to -1")


def _bode(loci: Response, omega: Array, gains: Gains) -> Any:
    figure, ((size,), (angle,)) = _figure(2, 1, gains, sharex=True)
    needs = gains.requirements
    _each(loci, lambda locus, **how: size.semilogx(omega, 20.0 * np.log10(np.abs(locus)), **how))
    _each(
        loci,
        lambda locus, **how: angle.semilogx(omega, np.degrees(np.unwrap(np.angle(locus))), **how),
    )
    for axes, limit, asked, label in (
        (size, 0.0, -needs.gain_margin, f"gain margin asked: {needs.gain_margin:g} dB"),
        (
            angle,
            -180.0,
            needs.phase_margin - 180.0,
            f"phase margin asked: {needs.phase_margin:g} deg",
        ),
    ):
        axes.axhline(limit, color="k", lw=0.6)
        axes.axhline(asked, color=COLOURS["asked"], ls="--", lw=1.0, label=label)
    size.set(ylabel="gain [dB]", ylim=DECIBELS)
    angle.set(
        xlabel="frequency [rad/s]",
        ylabel="phase [deg]",
        ylim=(-540.0, 180.0),
        yticks=range(-540, 181, 180),
    )
    _legend_below(figure, size, angle)
    return figure


def _nominal(robot: Robot, plants: Plants) -> StandingPlant:
    """Returns the plant on the most legs whose mean load is nearest to a third of the weight."""
    return min(plants.values(), key=lambda p: (-p.standing.sum(), abs(p.load(robot).mean() - 1.0)))


def _step(loops: PaperLoops, gains: Gains) -> Any:
    """Draws the forces on feet that are spread, and on a foot on a bump, with and without law."""
    figure, (row,) = _figure(1, 2, gains)
    robot, plant = loops.robot, _nominal(loops.robot, loops.plants)
    spread, share = splay(robot, plant), weight_share(robot)
    bump = np.zeros(len(spread))
    bump[2] = -1.0
    for system, label, colour, dashes in (
        (shifted(robot, plant), "without the law", COLOURS["without"], "--"),
        (
            closed_loop(robot, plant, gains.paper, delays=loops.delays),
            "with the law",
            COLOURS["worst"],
            "-",
        ),
    ):
        for axes, shift in zip(row, (spread, bump), strict=True):
            time, forces = disturbed(system, SHIFT * shift, duration=STEP_TIME)
            axes.step(
                time, -shift @ forces / share, where="post", color=colour, ls=dashes, label=label
            )
    row[0].set(title=f"feet spread by {1e3 * SHIFT:g} mm", ylabel="squeeze [weight / 3]")
    row[1].set(title=f"a foot on a bump of {1e3 * SHIFT:g} mm", ylabel="excess load [weight / 3]")
    for axes in row:
        axes.axhline(0.0, color="k", lw=0.6)
        axes.set(xlabel="time [s]")
    _legend_below(figure, row[0])
    return figure


def _margins(loci: Response, loops: PaperLoops, gains: Gains) -> Any:
    """Draws the least gain margin over further delay, and the poles over the shares."""
    figure, ((late, more),) = _figure(1, 2, gains)
    colour, needs = COLOURS["worst"], gains.requirements
    delays = np.linspace(0.0, MOST_DELAY, DELAYS)
    sizes = [critical_size(loci * np.exp(-1j * loops.omega * delay)).max() for delay in delays]
    late.plot(1e3 * delays, -20.0 * np.log10(sizes), color=colour, marker="o", ms=3, lw=1.0)
    late.axhline(
        needs.gain_margin, color=COLOURS["asked"], ls="--", lw=1.0, label="asked without it"
    )
    late.axhline(0.0, color="k", lw=0.6)
    late.set(xlabel="further delay [ms]", ylabel="gain margin [dB]")
    counts = sorted({int(plant.standing.sum()) for plant in loops.plants.values()})
    for count, colour in zip(counts, PALETTE[3:], strict=False):
        edge, name = max(
            (_edge(loops.loci(name, gains.paper)), name)
            for name, plant in loops.plants.items()
            if plant.standing.sum() == count
        )
        closed = [
            closed_loop(
                loops.robot, loops.plants[name], scaled(gains.paper, factor), delays=loops.delays
            )
            for factor in FACTORS
        ]
        radii = [spectral_radius(loop) for loop in closed]
        more.plot(FACTORS, radii, color=colour, marker="o", ms=3, lw=1.0, label=name)
        more.axvline(1.0 / edge, color=colour, ls="--", lw=1.0)
    more.axhline(1.0, color="k", lw=0.6)
    more.set(
        xlabel="factor on the shares [1]",
        ylabel="spectral radius [1]",
        title="dashed: by the margins",
        xlim=FACTORS[[0, -1]],
    )
    _legend_below(figure, late, more)
    return figure


def _edge(loci: Response) -> float:
    """Returns the inverse of the factor on the shares at which a plant becomes unstable."""
    return max(float(critical_size(loci).max()), float(10.0 ** (-static_margin(loci) / 20.0)))
