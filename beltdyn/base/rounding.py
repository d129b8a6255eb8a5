"""Numbers as texts, with the digits that their errors allow; percentages without exponent."""

from __future__ import annotations

import math
from typing import Any


def rounded(value: float, error: float | None, digits: int = 4) -> tuple[float, int]:
    """Round a number to the place of the first digit of its error; return it and its digits."""
    left = 2
    if error is not None and math.isfinite(error) and math.isfinite(value) and value != 0.0:
        of_error = math.log10(max(error, 1e-300))
        left = 1 + math.floor(math.log10(abs(value))) - math.floor(of_error)
    left = min(max(left, 2), digits)
    return float(f"{value:.{left - 1}e}"), left


def plain(value: Any) -> Any:
    """Return a value for JSON: lists for tuples, None for numbers that are not finite."""
    if isinstance(value, dict):
        return {key: plain(one) for key, one in value.items()}
    if isinstance(value, (tuple, list)):
        return [plain(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def percent(share: float) -> str:
    """Return a share in percent, to two digits or to the whole, none below 0.0001 %."""
    if 0.0 < abs(share) < 1e-6:
        return "<0.0001 %"
    return f"{100.0 * share:.2g} %" if abs(share) < 0.0995 else f"{100.0 * share:.0f} %"
