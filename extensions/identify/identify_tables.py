"""Tables and sentences on an identification, for the terminal and the report."""

from __future__ import annotations

from collections.abc import Sequence

from hexapod_cosim.extensions.identify.comparison import Difference
from hexapod_cosim.extensions.identify.excitation import Proposal
from hexapod_cosim.extensions.identify.fitting.friction_search import FrictionTrial
from hexapod_cosim.extensions.identify.fitting.misfit import REJECTED
from hexapod_cosim.extensions.identify.identified import NEAR, Estimate, Identified
from hexapod_cosim.extensions.identify.numbers.servo import GEAR
from hexapod_cosim.extensions.identify.page import TITLES, number
from hexapod_cosim.extensions.identify.rigid.base_parameters import base_of, group_parameters
from hexapod_cosim.extensions.identify.screening import left_out
from hexapod_cosim.extensions.identify.start import moving_at_rest
from hexapod_cosim.extensions.identify.unknowns import BIAS

MOTOR = {"servo.torque_constant", "servo.resistance"}
ESTIMATES = ("number", "unit", "before", "found", "95 % interval", "told", "nearest partner")
BASE = ("base parameter", "unit", "before", "least squares", "deviation", "found")
MISFIT = ("channel", "noise", "fitted", "held out")
TRIALS = ("friction model", "numbers", "sum of squares", "criterion, over the best one's")
ERRORS = ("channel", "unit", "before", "after", "ratio")


def base_values(found: Identified) -> list[tuple[str, str, float, float, float, float]]:
    """Returns name, unit, the robot file's value, that of linear least squares, its deviation and
    the identified robot's value of each base parameter.
    """
    if found.linear is None:
        return []
    one = found.linear.base
    own = base_of(found.file).values(group_parameters(found.robot))
    return [
        (name, unit, float(before), float(value), float(deviation), float(after))
        for name, unit, before, value, deviation, after in zip(
            one.names, one.units, one.before, one.values, one.deviations, own, strict=True
        )
    ]


def base_rows(found: Identified) -> list[list[str]]:
    """Returns the rows of a table with BASE, of base parameters that the logs tell well.

    Their deviation is below a tenth of the largest value of their unit.
    """
    values = base_values(found)
    largest = {unit: max(abs(row[2]) for row in values if row[1] == unit) for _, unit, *_ in values}
    return [
        [name, unit, number(before), number(value), f"{deviation:.2g}", number(after)]
        for name, unit, before, value, deviation, after in values
        if deviation < 0.1 * largest[unit]
    ]


def misfit_rows(found: Identified) -> list[list[str]]:
    """Returns the rows of a table with MISFIT."""
    return [
        [
            TITLES[key],
            number(found.fit.noise[key]),
            f"{one.value:.2f}",
            f"{found.fit.held_out[key].value:.2f}" if key in found.fit.held_out else "",
        ]
        for key, one in found.fit.misfit.items()
    ]


def warnings(found: Identified) -> list[str]:
    """Returns what a user must know of the result, as sentences."""
    texts = [text for one in found.experiments for text in one.log.warnings]
    texts += [
        text
        for one in found.experiments
        for text in left_out([column for number, column in found.bad if number == one.number])
    ]
    for one in found.experiments:
        moving = moving_at_rest(one.log)
        if moving:
            texts.append(
                f"The robot still moves at the start of {one.log.where}, where its commands stand "
                f"still ({moving}). The simulation begins with the mean of these rows, at rest: "
                "let the robot stand longer before the recording, or cut the first rows off."
            )
    if _has(found, "motor_angle") and found.file.servo.gear_stiffness == 0.0:
        texts.append(
            "The log has the angles of rotors, but the gears of the robot file are rigid: their "
            "stiffness and play are not sought. Give a first servo.gear_stiffness, of about ten "
            "times kp."
        )
    if found.fit.decrement > 1.0:
        texts.append(
            f"The search ended {found.fit.decrement:.1f} deviations before the optimum of the "
            "linearised problem. The intervals contain this step, but are a guess: give a longer "
            "log, or begin again from the robot file that was written."
        )
    worst = found.fit.unexplained
    if found.rejected:
        named = ", ".join(
            f"{TITLES[key].lower()} ({value:.1f})" for key, value in found.fit.rejected.items()
        )
        texts.append(
            "The logs reject the model: mean squares of residuals over those of the readings' "
            f"noise are {REJECTED:g} and more in {named}. A fit of a wrong model has wrong "
            "numbers, so none is told and all stay as in the robot file: find all groups of "
            "numbers, look at the curves of these channels, or choose another model of servo or "
            "ground." + _other_friction(found)
        )
    elif worst:
        named = ", ".join(f"{TITLES[key].lower()} ({value:.1f})" for key, value in worst.items())
        texts.append(
            "The model does not explain this log: mean squares of residuals over those of the "
            f"readings' noise are too large in {named}. The intervals are wider for it, but may "
            "miss the true numbers: find all groups of numbers, look at the curves of these "
            "channels, or choose another model of servo or ground."
        )
    return texts


def _other_friction(found: Identified) -> str:
    """Returns how other friction models are tried, where the servo has one, as a sentence."""
    if found.trials or found.file.servo.drive != "motor":
        return ""
    return " --friction best tries the friction models M1 to M6 of the gears."


def estimate_rows(estimates: Sequence[Estimate]) -> list[list[str]]:
    """Returns the rows of a table with ESTIMATES."""
    return [
        [
            one.key,
            one.unit,
            number(one.before),
            one.found,
            one.interval,
            "yes" if one.told else "in part" if one.combination else "no",
            f"{one.partner} {one.correlation:+.2f}" if abs(one.correlation) > NEAR else "",
        ]
        for one in estimates
    ]


def shown_estimates(estimates: Sequence[Estimate]) -> tuple[list[Estimate], int]:
    """Returns the estimates for a terminal without biases that may be 0, and how many those are."""
    shown = [
        one
        for one in estimates
        if not (one.key.startswith(BIAS) and one.low <= 0.0 <= one.high and one.told)
    ]
    return shown, len(estimates) - len(shown)


def error_rows(pairs: Sequence[tuple[Difference, Difference]]) -> list[list[str]]:
    """Returns the rows of a table with ERRORS."""
    return [
        [
            TITLES[one.channel],
            one.unit,
            number(one.rms),
            number(other.rms),
            f"{one.rms / other.rms:.1f}" if other.rms > 0.0 else "",
        ]
        for one, other in pairs
    ]


def untold_text(found: Identified) -> str:
    """Returns what the logs cannot tell, as a sentence."""
    if found.rejected:
        return "The logs reject the model, so they tell no number."
    untold = [one.key for one in found.estimates if not one.told and not one.combination]
    text = (
        f"The logs tell {found.rank} independent combinations of {len(found.fit.rows)} numbers "
        "better than the robot file. "
    )
    if not untold:
        return text + "They tell every number."
    text += f"They do not tell: {', '.join(untold)}."
    text += "".join(_together(one) for one in found.estimates if one.combination)
    if MOTOR & {one.key for one in found.estimates if not one.told} and not _has(found, "current"):
        text += (
            " Currents would tell both the motor's torque constant and its resistance: record "
            "LF.coxa.current [A], ..."
        )
    if set(GEAR) & set(untold) and not _has(found, "motor_angle"):
        text += (
            " Elasticity and play of gears show most in the angles of rotors beside those of "
            "links: record LF.coxa.motor_angle [rad], ..."
        )
    return text


def _together(one: Estimate) -> str:
    """Returns which combination is told instead of a number, as a sentence."""
    return (
        f" Of {one.key} they tell only {one.combination}: its value {one.found} holds as long as "
        "the other numbers are the file's."
    )


def _has(found: Identified, channel: str) -> bool:
    """Returns whether readings of a channel are compared."""
    return any(channel in one.channels for one in found.experiments)


def friction_text(trials: Sequence[FrictionTrial]) -> str:
    """Returns which friction model explains the logs best, as a sentence; empty without trials."""
    if not trials:
        return ""
    best, *others = trials
    text = f"Of the friction models M1 to M6, {best.model.upper()} explains the logs best"
    if others:
        more = others[0].criterion - best.criterion
        text += f"; the next one, {others[0].model.upper()}, has a criterion larger by {more:.1f}"
    return text + " (BIC: sum of squares over the noise, and log(readings) for each number)."


def trial_rows(found: Identified) -> list[list[str]]:
    """Returns the rows of a table with TRIALS."""
    least = min((one.criterion for one in found.trials), default=0.0)
    return [
        [one.model, str(one.numbers), f"{one.cost:.1f}", f"{one.criterion - least:.1f}"]
        for one in found.trials
    ]


def proposal_text(proposals: Sequence[Proposal]) -> str:
    """Returns which experiment would tell more, as a sentence."""
    if not proposals:
        return "No walk was tried."
    if not proposals[0].tells:
        return "None of the walks that were tried would tell more."
    best = proposals[0]
    return f"{best.title} would tell: {', '.join(best.tells)}."
