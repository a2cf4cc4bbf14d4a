"""Draws figures of the paper's laws: Bode and Nyquist diagrams, responses to shifts, margins.

The diagrams show all eigenloci; margins are drawn over delay and load.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import control
import numpy as np

from hexapod_cosim.controller.design.closed import disturbed, splay
from hexapod_cosim.controller.design.laws import Laws, delay, delay_response, delay_steps
from hexapod_cosim.controller.design.loci import (
    Loci,
    Plants,
    Response,
    all_loci,
    critical_size,
    frequencies,
    quick_margins,
)
from hexapod_cosim.controller.design.paper import paper_loci, paper_loop, shifted
from hexapod_cosim.controller.design.standing import StandingPlant, weight_share
from hexapod_cosim.controller.figure_style import DPI, PALETTE, SETTINGS, UNDATED, WIDTH
from hexapod_cosim.controller.gains import Gains, GainsError
from hexapod_cosim.controller.plane import Array
from hexapod_cosim.models import Robot

DRAWN = 200  # frequencies
STEP_TIME = 0.6  # s    shown of an answer
SHIFT = 0.001  # m    of the feet
MOST_DELAY, DELAYS = 0.05, 21  # s    further delay shown, and in how many points
DECIBELS = (-40.0, 30.0)
SCALES = (40.0, 180.0)  # dB, deg    ends of the margins' scales
COLOURS = {"worst": PALETTE[3], "others": "0.75", "asked": PALETTE[0], "without": PALETTE[1]}
LAWS = {"tangential PID": (PALETTE[2], "o"), "suspension": (PALETTE[4], "s")}
TITLES = tuple(LAWS)
NAMES = ("bode", "nyquist", "step", "margins")


def plot_design(robot: Robot, gains: Gains, plants: Plants, directory: str | Path) -> list[Path]:
    """Writes `bode`, `nyquist`, `step` and `margins` as SVG and PNG; returns the paths.

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
    laws = Laws(
        slip=gains.paper_slip,
        suspension=gains.paper_suspension,
        period=gains.period,
        delays=delay_steps(gains.requirements, period=gains.period),
    )
    loci = all_loci(robot, plants, frequencies(gains.period, DRAWN), of=paper_loci)
    loops = [one.values * law for one, law in zip(loci, laws.responses(loci[0].omega), strict=True)]
    from matplotlib import rc_context  # noqa: PLC0415  slow to import

    folder = Path(directory)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with rc_context(SETTINGS):
            figures = (
                _bode(loops, loci[0].omega, gains),
                _nyquist(loops, loci[0].omega, gains),
                _step(robot, plants, laws, gains),
                _margins(robot, plants, loci, loops, gains),
            )
            return [
                path
                for name, figure in zip(NAMES, figures, strict=True)
                for path in _save(figure, folder, name)
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


def _each(loops: Response, draw: Callable[..., Any]) -> None:
    """Draws all loci; the one that comes nearest to -1 is drawn last, on top."""
    worst = int(np.abs(1.0 + loops).min(axis=1).argmin())
    for k, loop in enumerate(loops):
        if k != worst:
            draw(loop, color=COLOURS["others"], lw=0.5, label="_")
    draw(loops[worst], color=COLOURS["worst"], lw=1.4, label="nearest to -1")


def _bode(loops: list[Response], omega: Array, gains: Gains) -> Any:
    figure, grid = _figure(2, 2, gains, sharex=True)
    needs = gains.requirements
    for (size, angle), all_of, title in zip(grid.T, loops, TITLES, strict=True):
        _each(
            all_of,
            lambda loop, axes=size, **style: axes.semilogx(
                omega, 20.0 * np.log10(np.abs(loop)), **style
            ),
        )
        _each(
            all_of, lambda loop, axes=angle, **style: axes.semilogx(omega, _degrees(loop), **style)
        )
        size.axhline(0.0, color="k", lw=0.6)
        size.axhline(
            -needs.gain_margin,
            color=COLOURS["asked"],
            ls="--",
            lw=1.0,
            label=f"gain margin asked: {needs.gain_margin:g} dB",
        )
        angle.axhline(-180.0, color="k", lw=0.6)
        label = f"phase margin asked: {needs.phase_margin:g} deg"
        angle.axhline(
            needs.phase_margin - 180.0, color=COLOURS["asked"], ls="--", lw=1.0, label=label
        )
        size.set(title=f"loops of the {title}", ylabel="gain [dB]", ylim=DECIBELS)
        angle.set(
            xlabel="frequency [rad/s]",
            ylabel="phase [deg]",
            ylim=(-540.0, 180.0),
            yticks=range(-540, 181, 90),
        )
    _legend_below(figure, *grid[:, 0])
    return figure


def _degrees(loop: Response) -> Array:
    return np.degrees(np.unwrap(np.angle(loop)))


def _nyquist(loops: list[Response], omega: Array, gains: Gains) -> Any:
    figure, grid = _figure(1, 2, gains)
    figure.set_figheight(4.4)
    needs, turn = gains.requirements, np.linspace(0.0, 2.0 * np.pi, 200)
    edge = np.radians(needs.phase_margin)
    for axes, all_of, title in zip(grid[0], loops, TITLES, strict=True):
        _each(all_of, lambda loop, axes=axes, **style: axes.plot(loop.real, loop.imag, **style))
        axes.plot(np.cos(turn), np.sin(turn), color="k", lw=0.5)
        arc = np.pi + np.linspace(-edge, edge, 60)
        axes.plot(
            np.cos(arc),
            np.sin(arc),
            color=COLOURS["asked"],
            lw=2.0,
            label="margins asked: not through here",
        )
        axes.plot(
            [-1.0, -(10.0 ** (-needs.gain_margin / 20.0))],
            [0.0, 0.0],
            color=COLOURS["asked"],
            lw=2.0,
        )
        axes.plot([-1.0], [0.0], "k+", ms=10)
        axes.set(
            title=f"loops of the {title}",
            xlabel="real part [1]",
            ylabel="imaginary part [1]",
            aspect="equal",
        )
        axes.set(xlim=(-1.6, 1.6), ylim=(-1.6, 1.6), xticks=range(-1, 2), yticks=range(-1, 2))
    _legend_below(figure, grid[0, 0])
    return figure


def _nominal(robot: Robot, plants: Plants) -> StandingPlant:
    """Returns the plant on the most legs whose mean load is nearest to a third of the weight."""
    most = max(plant.standing.sum() for plant in plants.values())
    return min(
        (plant for plant in plants.values() if plant.standing.sum() == most),
        key=lambda p: abs(p.load(robot).mean() - 1.0),
    )


def _step(robot: Robot, plants: Plants, laws: Laws, gains: Gains) -> Any:
    figure, (row,) = _figure(1, 3, gains)
    plant = _nominal(robot, plants)
    with_laws, without = paper_loop(robot, plant, laws), shifted(robot, plant)
    spread, share = splay(robot, plant), weight_share(robot)
    bump = np.zeros(len(spread))
    bump[2] = -SHIFT
    for system, label, colour, dashes in (
        (without, "without the laws", COLOURS["without"], "--"),
        (with_laws, "with both laws", COLOURS["worst"], "-"),
    ):
        time, forces = disturbed(system, SHIFT * spread, duration=STEP_TIME)
        row[0].step(
            time, -spread @ forces / share, where="post", color=colour, ls=dashes, label=label
        )
        time, forces = disturbed(system, bump, duration=STEP_TIME)
        row[1].step(time, forces[2] / share, where="post", color=colour, ls=dashes, label=label)
    late = laws.systems[1] * delay(laws.delays, period=laws.period)
    deflection = np.asarray(control.forced_response(late, time, forces[2][None]).outputs)
    row[2].step(
        time, 1e3 * deflection.reshape(-1), where="post", color=COLOURS["worst"], label="suspension"
    )
    row[0].set(title=f"feet spread by {1e3 * SHIFT:g} mm", ylabel="squeeze [weight / 3]")
    row[1].set(title=f"a foot on a bump of {1e3 * SHIFT:g} mm", ylabel="excess load [weight / 3]")
    row[2].set(title="the same bump", ylabel="suspension's deflection [mm]")
    for axes in row:
        axes.axhline(0.0, color="k", lw=0.6)
        axes.set(xlabel="time [s]")
    _legend_below(figure, row[0])
    return figure


def _margins(
    robot: Robot, plants: Plants, loci: tuple[Loci, Loci], loops: list[Response], gains: Gains
) -> Any:
    """Draws the least margins of all loops over further delay, and over the load."""
    figure, grid = _figure(2, 2, gains, sharey="row", sharex="col")
    needs, load = (
        gains.requirements,
        {name: round(float(plant.load(robot).mean()), 2) for name, plant in plants.items()},
    )
    delays, loads, omega = (
        np.linspace(0.0, MOST_DELAY, DELAYS),
        sorted(set(load.values())),
        loci[0].omega,
    )
    for all_of, one, (title, (colour, marker)) in zip(loops, loci, LAWS.items(), strict=True):
        late = [
            _least(all_of * delay_response(1, omega, period=float(more)), omega) for more in delays
        ]
        borne = [
            _least(all_of[[load[name] == value for name in one.names]], omega) for value in loads
        ]
        for column, x, found in ((0, 1e3 * delays, late), (1, loads, borne)):
            for axes, values in zip(grid[:, column], np.array(found).T, strict=True):
                axes.plot(
                    x, values, color=colour, marker=marker, ms=3, lw=1.0, clip_on=False, label=title
                )
    for axes, asked, label in zip(
        grid,
        (needs.gain_margin, needs.phase_margin),
        ("gain margin [dB]", "phase margin [deg]"),
        strict=True,
    ):
        axes[0].set(ylabel=label)
        for one_of in axes:
            one_of.axhline(asked, color=COLOURS["asked"], ls="--", lw=1.0, label="asked for")
            one_of.axhline(0.0, color="k", lw=0.6)
    grid[1, 0].set(xlabel="further delay [ms]", title=f"{SCALES[1]:g} deg: no crossing")
    grid[1, 1].set(xlabel="mean load of the standing feet [weight / 3]")
    figure.align_ylabels(grid[:, 0])
    _legend_below(figure, grid[0, 0])
    return figure


def _least(loops: Response, omega: Array) -> tuple[float, float]:
    """Returns the least gain [dB] and phase [deg] margins of loops; negative: unstable.

    Without a crossing it is the end of the figure's scale.
    """
    critical, phase = (
        float(critical_size(loops).max()),
        min(quick_margins(loop, omega).phase for loop in loops),
    )
    gain = -20.0 * np.log10(critical) if critical else np.inf
    return min(float(gain), SCALES[0]), float(np.copysign(min(phase, SCALES[1]), gain))
