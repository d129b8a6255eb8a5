"""Progress on stderr: over the time that is simulated, over a number of runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress


def _terminal(enabled: bool) -> Console | None:
    """Return standard error; None if progress is not wanted there, or clutter in a file or pipe."""
    if not enabled:
        return None
    from rich.console import Console

    console = Console(stderr=True)
    return console if console.is_terminal or console.is_jupyter else None


def _bar(console: Console, label: str, *columns: Any) -> Progress:
    """Return a bar that goes when it is done, with these columns to the right of it."""
    from rich.progress import BarColumn, Progress, TextColumn

    bar, texts = BarColumn(), [TextColumn(one) if isinstance(one, str) else one for one in columns]
    return Progress(TextColumn(label), bar, *texts, console=console, transient=True)


@contextmanager
def over_time(
    enabled: bool, label: str, start: float, end: float | None
) -> Iterator[Callable[[float], None]]:
    """Show the simulated time, and without an end only that; yield a function of it."""
    console = _terminal(enabled)
    if console is None:
        yield lambda _time: None
        return
    from rich.progress import TimeRemainingColumn

    with _bar(console, label, "t = {task.fields[time]:.4g} s", TimeRemainingColumn()) as bar:
        task = bar.add_task(label, total=None if end is None else end - start, time=start)
        yield lambda now: bar.update(task, completed=now - start, time=now)


@contextmanager
def counted(enabled: bool, label: str) -> Iterator[Callable[[int, int | None, str], None]]:
    """Show runs done of all, and the next; yield a function of these numbers and a text."""
    console = _terminal(enabled)
    if console is None:
        yield lambda _done, _all, _text: None
        return
    from rich.progress import MofNCompleteColumn, TimeRemainingColumn

    right = (MofNCompleteColumn(), TimeRemainingColumn(), "{task.fields[text]}")
    with _bar(console, label, *right) as bar:
        task = bar.add_task(label, total=None, text="")
        yield lambda done, of, text: bar.update(task, completed=done, total=of, text=text)
