"""A benchmark of programs that find parts by touch: sets of readings whose truth is known, and what is scored.

Any program enters as a few lines of Python (:mod:`tanteo.bench.rivals` has five). All are run by one worker and scored
by one code, tanteo first: ``tanteo bench``. ``docs/bench.md`` says what each number means.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.bench.generated import GENERATED, generate
    from tanteo.bench.running import METHODS, Outcome, at_work, check_method, run
    from tanteo.bench.scoring import Score, largest_corner_error, score, with_decisions
    from tanteo.bench.set_files import read_set, write_set
    from tanteo.bench.sets import BenchScene, BenchSet, Placement
    from tanteo.bench.tables import bench_picture, decision_table, read_scores, score_table, write_scores

__all__ = [
    "GENERATED",
    "METHODS",
    "BenchScene",
    "BenchSet",
    "Outcome",
    "Placement",
    "Score",
    "at_work",
    "bench_picture",
    "check_method",
    "decision_table",
    "generate",
    "largest_corner_error",
    "read_scores",
    "read_set",
    "run",
    "score",
    "score_table",
    "with_decisions",
    "write_scores",
    "write_set",
]

__getattr__: Callable[[str], Any]
__dir__: Callable[[], list[str]]
__getattr__, __dir__ = lazy(
    __name__,
    {
        "generated": "GENERATED generate",
        "running": "METHODS Outcome at_work check_method run",
        "scoring": "Score largest_corner_error score with_decisions",
        "set_files": "read_set write_set",
        "sets": "BenchScene BenchSet Placement",
        "tables": "bench_picture decision_table read_scores score_table write_scores",
    },
)
