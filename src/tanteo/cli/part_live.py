"""What ``tanteo sense part`` shows while the hand works: a line for every question."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from tanteo.cli.printing import emit, has_colour, printable

if TYPE_CHECKING:
    from tanteo.execution import Visit


@contextmanager
def shown_live(*, verbose: bool) -> Iterator[Callable[[Visit], None]]:
    """A line for every question on standard error; on a terminal also that the hand is under way."""
    if not sys.stderr.isatty():
        yield lambda visit: emit(visit_lines(visit, verbose=verbose), sys.stderr)
        return
    from rich.console import Console

    console = Console(stderr=True, no_color=not has_colour(sys.stderr), highlight=False)
    with console.status("sensing") as status:

        def watch(visit: Visit) -> None:
            for line in visit_lines(visit, verbose=verbose):
                console.print(line, markup=False, soft_wrap=True)
            status.update(f"sensing: {visit.seconds:.0f} s simulated")

        yield watch


def visit_lines(visit: Visit, *, verbose: bool = False) -> list[str]:
    """What was asked and what came of it, in one line; with the motions below if there is to be more."""
    action, step = visit.action, visit.step
    words = f"{action.number:3}  {visit.seconds:6.1f} s {visit.travel:6.2f} m  {action.face} of {action.part}"
    if step is not None and len(step.ids):
        count = "1 reading" if len(step.ids) == 1 else f"{len(step.ids)} readings"
        words += f", {count}: {state_words(visit)}"
    words += f" ({visit.note})" if visit.note else ""
    lines = [printable(words)]
    if verbose:
        lines.append(f"       {printable(action.words)}")
        lines += [f"       {m.seconds:6.2f} s  {m.name:8}  {m.status:8}  {printable(m.message)}" for m in visit.motions]
    return lines


def state_words(visit: Visit) -> str:
    """The leading part, how probable it is, and how well it is placed."""
    step = visit.step
    if step is None or step.part < 0:
        return "no part explains them"
    probability = float(step.probabilities[step.part])
    words = f"{visit.leader} P = {probability:.3f}" if probability < 0.9995 else f"{visit.leader} P > 0.999"
    return f"{words}, largest corner sd {1e3 * step.corner_sd:.2f} mm"
