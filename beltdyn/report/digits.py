"""Digits that a report prints of a number: as many as its error allows."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..base.checks import Array
from ..base.rounding import rounded
from ..outputs.accuracy_report import Accuracy
from .rows import RESIDUAL, MountRow, PulleyRow, ReportData, SpanRow, Spread

#: What stands for a value that is not known or does not apply.
NONE = "-"
#: Error of speeds and torques where that of the power is not known: what belts creep at most.
CREEPS = 5e-3
#: Spread of samples over their mean that rounding leaves of a constant.
ROUNDING = 1e-9


def number(value: float | None, digits: int = 4) -> str:
    """Return a number with that many digits, without an exponent where it reads as well."""
    if value is None or math.isnan(value):
        return NONE
    if math.isinf(value):
        return "none"
    value = float(f"{value:.{digits - 1}e}")  # 9.97 is 10 and has no digit more than 9.94
    size = abs(value)
    if size == 0.0:
        return "0"
    if 1e-3 <= size < 1e6:
        return f"{value:.{max(0, digits - 1 - math.floor(math.log10(size)))}f}"
    return f"{value:.{digits - 1}e}"


def within(value: float | None, error: float | None, digits: int = 4) -> str:
    """Return a number with as many digits as its error allows, at most so many."""
    if value is None or not math.isfinite(value):
        return number(value)
    return signed(number(*rounded(value, error, digits)))


def signed(shown: str) -> str:
    """Return a number without the sign of a zero."""
    return shown.removeprefix("-") if not shown.strip("-0.") else shown


def fixed(value: float | None, scale: float, decimals: int) -> str:
    """Return a number times a factor with so many decimals."""
    return NONE if value is None else signed(f"{scale * value:.{decimals}f}")


def largest(values: Iterable[float | None]) -> float:
    """Return the largest magnitude of those that are known, 0 if none is."""
    return max((abs(one) for one in values if one is not None), default=0.0)


def placed(
    value: Spread | None,
    share: float,
    scale: float = 1.0,
    ends: Spread | None = None,
    size: float | None = None,
) -> tuple[str, str, str]:
    """Return mean, least and most, all rounded to the place that the error allows."""
    if value is None:
        return NONE, NONE, NONE
    ends = ends or value
    mean, least, most = scale * value.mean, *sorted((scale * ends.least, scale * ends.most))
    known = [one for one in (mean, least, most) if math.isfinite(one)]
    size = largest(known) if size is None else abs(scale * size)
    if not 1e-3 <= size < 1e6:
        return number(mean, 2), number(least, 2), number(most, 2)
    shown, digits = rounded(size, share * size)
    place = digits - 1 - math.floor(math.log10(shown))
    texts = [
        signed(f"{round(one, place):.{max(0, place)}f}") if math.isfinite(one) else number(one)
        for one in (mean, least, most)
    ]
    return texts[0], texts[1], texts[2]


def between(ends: Sequence[str]) -> str:
    """Return a range from its least and most."""
    return NONE if NONE in ends else " to ".join(ends)


# --- Errors, NaN where they are not known ---------------------------------------------------------


def or_nan(error: float | None) -> float:
    """Return an error, NaN for one that is not known."""
    return math.nan if error is None else error


def mean_tension(report: ReportData) -> float:
    """Return the mean of the mean tensions of all spans, absolute, NaN if none is known [N]."""
    means = [row.tension.mean for row in report.spans if row.tension is not None]
    means = [one for one in means if math.isfinite(one)]  # of a span that is there
    return abs(sum(means) / len(means)) if means else math.nan


def tension_off(report: ReportData) -> float:
    """Return the error of mean tensions, a share of the mean of all spans [N]."""
    return or_nan(report.tension_error) * mean_tension(report)


def of_tension(
    report: ReportData, value: Spread | None, spans: float = 1.0, ends: Spread | None = None
) -> tuple[str, str, str]:
    """Return mean, least and most of the tensions of so many spans, to the place of the mean."""
    if value is None or not value.mean:
        return placed(value, math.nan, ends=ends)
    share = spans * tension_off(report) / abs(value.mean)
    return placed(value, share, ends=ends, size=value.mean)


def speed_errors(accuracy: Accuracy, speeds: Array, prescribed: NDArray[np.bool_]) -> Array:
    """Return the errors of the mean speeds of pulleys (n_p,) [rad/s]; none of prescribed ones."""
    share = of_loads(accuracy)  # beside a prescribed speed others are off by a creep at most
    share = min(share, CREEPS) if prescribed.any() else share
    return np.where(prescribed, 0.0, share * np.abs(speeds))


def of_loads(accuracy: Accuracy) -> float:
    """Return the relative error of speeds and torques that follow from loads and losses [1]."""
    # What is lost on the way of the power shifts the speed at which loads balance, and the torque
    # that a prescribed speed needs.
    return accuracy["speed"].known or accuracy["power"].known or CREEPS


def given(value: Spread | None) -> bool:
    """Return whether a torque is set and constant: one that links transmit varies by more."""
    return value is not None and value.most - value.least <= ROUNDING * abs(value.mean)


def of_speed(report: ReportData, row: PulleyRow) -> float:
    """Return the error of a pulley's speed [1]; beside a prescribed one, at most its creep."""
    if row.prescribed:
        return 0.0
    slower = [abs(one.slower) for one in report.creep if one.name == row.name]
    return slower[0] if slower and _led(report) else of_loads(report.accuracy)


def _led(report: ReportData) -> bool:
    """Return whether the speed of the driving pulley is prescribed."""
    return any(row.prescribed for row in report.pulleys if row.name == report.driver)


def belt_speed(report: ReportData) -> str:
    """Return the belt's speed; its error is that of creep where a speed is prescribed."""
    speed, share = abs(report.belt_speed or 0.0), of_loads(report.accuracy)
    return within(speed, speed * (min(share, CREEPS) if _led(report) else share))


def of_grip(report: ReportData) -> float:
    """Return the error of the friction limit [1], from tensions less rho v^2."""
    pulls = [one for row in report.pulleys for one in (row.tight, row.slack) if one is not None]
    return tension_off(report) * len(pulls) / sum(pulls) if sum(pulls) > 0.0 else math.nan


def margin(report: ReportData, value: float | None) -> str:
    """Return a margin of torque, with the error of the friction limit, to two decimals."""
    if value is None or not math.isfinite(value):
        return NONE if value is None else "later"
    if not value > 0.0:
        return number(value, 2)
    decimals = max(1, 3 + math.floor(math.log10(value)))
    return within(value, of_grip(report) * value, decimals)


def of_ratio(report: ReportData, row: PulleyRow) -> float:
    """Return the error of a ratio of tensions with equal errors."""
    if row.ratio is None or not row.slack:
        return math.nan
    return tension_off(report) * abs(row.ratio - 1.0) / row.slack


def used(report: ReportData, row: PulleyRow, scale: float = 100.0) -> tuple[str, str, str]:
    """Return the friction in use [1] times a factor, by the logarithm of a ratio, and its range."""
    part = row.used
    mean = row.used_range if part is None else Spread(part, part, part)
    texts = placed(mean, _off_used(report, row), scale, row.used_range, part or None)
    return texts[0], texts[1], texts[2].replace("none", "slack")


def most_used(report: ReportData, row: PulleyRow) -> str:
    """Return the most friction in use of any moment [%]."""
    most = None if row.used_range is None else 100.0 * row.used_range.most
    error = _off_used(report, row) * (most or 0.0)
    return within(most, error).replace("none", "slack")


def _off_used(report: ReportData, row: PulleyRow) -> float:
    """Return the error of the friction in use, as a share of it."""
    part, ratio = row.used, row.ratio
    if not part or not ratio:
        return math.nan
    # of the logarithm over the ratio's; a tenth at best, NaN stays
    return max(of_ratio(report, row) * part / (ratio * math.log(ratio)), 1e-3) / part


def line_frequency(report: ReportData, row: SpanRow | MountRow) -> str:
    """Return the frequency of a line of something that swings under the belt's tension."""
    if row.frequency is None:
        return NONE
    return within(row.frequency, 0.5 * or_nan(report.tension_error) * row.frequency, 3)


def loss(report: ReportData, power: float, value: float | None = None) -> str:
    """Return a power loss, total or by one cause; its error is at most the loss."""
    value = power if value is None else value
    error = or_nan(report.efficiency_error) * total(report, "in")
    return within(value, error * abs(value / power) if power else math.nan)


def total(report: ReportData, kind: str) -> float:
    """Return the sum of the powers of a kind [W]."""
    return sum(one.power for one in report.powers if one.kind == kind)


def efficiency(report: ReportData) -> str:
    """Return the efficiency in percent, to two decimals at most."""
    value, error = report.efficiency or 0.0, report.efficiency_error or 0.0
    return within(round(100.0 * value, 2), 100.0 * error)


def lost(report: ReportData) -> tuple[str, bool]:
    """Return the total loss, and whether it exceeds its error and the residual of the ledger."""
    power, put_in = total(report, "lost"), total(report, "in")
    unknown = max(abs(report.powers[RESIDUAL].power), (report.efficiency_error or 0.0) * put_in)
    if abs(power) < unknown:
        return f"less than some {number(abs(power) + unknown, 2)} W lost", False
    if power < 0.0:  # dampers give nothing back
        return f"{loss(report, -power)} W given back by friction, which had stored it", False
    return f"{loss(report, power)} W lost", True
