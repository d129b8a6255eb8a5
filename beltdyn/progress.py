"""Progress over a number of runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

__all__ = ["counted"]


@contextmanager
def counted(enabled: bool, label: str) -> Iterator[Callable[[int, int, str], None]]:
    """Show runs done of all, and which is next, on stderr; nothing in a file or pipe.

    Gives a function of the number done, the number of all and a text; safe in several threads.
    """
    if not enabled:
        yield lambda _done, _all, _text: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    console = Console(stderr=True)
    if not (console.is_terminal or console.is_jupyter):
        yield lambda _done, _all, _text: None
        return
    bar = Progress(
        TextColumn(label),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[text]}"),
        console=console,
        transient=True,
    )
    with bar:
        task = bar.add_task(label, total=None, text="")
        yield lambda done, of, text: bar.update(task, completed=done, total=of, text=text)
