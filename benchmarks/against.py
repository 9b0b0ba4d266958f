"""Two commits on the same scenes, one table: ``python benchmarks/against.py OLD [NEW] [--rows NAME ...]``.

A side is any commit of this repository, or ``.``, the working tree in the environment that runs this. A commit gets a
worktree and an environment of its own below the cache folder (some minutes the first time, kept for the next time). A
side is one process, ``against_worker.py``; both get the same scenes (``against_scenes.py``) by turns, a few at a time,
so that a machine that slows down slows both. One thread, CPU time; preparing a part is not timed.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from against_scenes import ROWS
from common import Table, machine

ROOT = Path(__file__).resolve().parents[1]
FILES = ROOT / "examples" / "parts", ROOT / "src" / "tanteo" / "bench" / "demo" / "parts"
BRACKET = ROOT.parent / "shared" / "data" / "bracket" / "bracket.stl"
CACHE = Path.home() / ".cache" / "tanteo-against"
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

COLUMNS = (
    "scenes", "side", "right", "among", "claimed / right", "NEES / dof, mean (median)", "in the 95 % region",
    "P(unknown)", "ms, median", "ms, worst", "times the first, median, worst",
)  # fmt: skip

TEXT = """\
Right: the best mode is the true part within 3 mm and 5 degrees of its pose or within ten standard deviations (without
the latter for bracket_*; 0.7 mm for thin_sheet). The part of parts12_stranger is no candidate; there, the answer
"unknown"
is right. Among: such a mode anywhere in the answer. Claimed: mean probability of the best mode, beside the
share of them that is right. NEES: per degree of freedom, of right answers; if covariances are true, 95 % of such means
are in the interval and medians are about 0.89. Region: how often that of the best mode holds the truth, over answers
that are recognized. Times of sessions are for one reading.{}"""


@dataclass
class Side:
    """A commit or the working tree, and its process.

    Attributes:
        name: for the table.
        revision: full hash; of the working tree its description.
        python: the interpreter that has it.
        folder: for what it remembers of parts.
        fixed: a commit: what was measured once stays true.
    """

    name: str
    revision: str
    python: Path
    folder: Path
    fixed: bool
    process: subprocess.Popen | None = field(default=None, init=False)

    def answer(self, row: str, number: int, seed: int) -> dict:
        """Return the reply of the worker process; if the process died, return a failure and start another for the next
        scene."""
        process = self.process or self.start()
        try:
            print(json.dumps((row, number, seed)), file=process.stdin, flush=True)
            line = process.stdout.readline()
        except BrokenPipeError:
            line = ""
        if line:
            return json.loads(line)
        self.process = None
        return {"failed": process.wait()}

    def start(self) -> subprocess.Popen:
        """Start the process.

        Raises:
            SystemExit: it does not get as far as the first scene.
        """
        environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | ONE_THREAD
        command = [str(self.python), str(ROOT / "benchmarks" / "against_worker.py"), *map(str, (*FILES, BRACKET))]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            env=environment | {"TANTEO_CACHE": str(self.folder / "parts")},
        )  # fmt: skip
        if not self.process.stdout.readline():
            raise SystemExit(f"{self.name}: the worker did not start: {' '.join(command)}")
        return self.process

    def stop(self) -> None:
        """End the process, if there is one."""
        if self.process is not None:
            self.process.communicate()


def side_of(text: str, cache: Path) -> Side:
    """Return the side that an argument names, and build it if necessary."""
    if text == ".":
        return Side("working tree", git("describe", "--always", "--dirty"), Path(sys.executable), cache / "here", False)
    revision = git("rev-parse", "--verify", f"{text}^{{commit}}")
    folder = cache / revision
    python = folder / "venv" / ("Scripts" if os.name == "nt" else "bin") / "python"
    if not (folder / "ready").exists():
        build(revision, folder, python)
    return Side(revision[:9], revision, python, folder, True)


def build(revision: str, folder: Path, python: Path) -> None:
    """Make a worktree of the commit and an environment with it."""
    print(f"building {revision} in {folder}", file=sys.stderr, flush=True)
    source = folder / "source"
    if not source.exists():
        git("worktree", "add", "--force", "--detach", str(source), revision)
    subprocess.run([sys.executable, "-m", "venv", "--clear", str(folder / "venv")], check=True)
    install = [str(python), "-m", "pip", "--disable-pip-version-check", "install", "--quiet", "-c", "constraints.txt"]
    subprocess.run([*install, ".[step]"], cwd=source, check=True)
    (folder / "ready").touch()


def git(*arguments: str) -> str:
    return subprocess.run(
        ["git", "-C", str(ROOT), *arguments], check=True, stdout=subprocess.PIPE, text=True
    ).stdout.strip()


def kept_in(files: list[Path]) -> dict:
    """Answers that files hold, by revision, row, number and seed."""
    lines = [json.loads(line) for file in files for line in file.read_text().splitlines() if line.strip()]
    return {(line["revision"], line["row"], line["number"], line["seed"]): line for line in lines}


def run(sides: list[Side], rows: dict[str, int], options: argparse.Namespace) -> Iterator[tuple[str, list[list[dict]]]]:
    """Yield each row with the answers of each side, in order of their numbers."""
    kept = kept_in(options.kept)
    for row, count in rows.items():
        answers = [[{}] * count for _ in sides]
        for start in range(0, count, options.block):
            turns = range(len(sides)) if start // options.block % 2 == 0 else reversed(range(len(sides)))
            for s in turns:
                for k in range(start, min(start + options.block, count)):
                    key = sides[s].revision, row, k, options.seed
                    known = kept.get(key) if sides[s].fixed else None
                    answers[s][k] = known or sides[s].answer(row, k, options.seed)
                    if known is None and options.keep:
                        keep(options.keep, key, answers[s][k])
        print(f"{row}: {count} scenes", file=sys.stderr, flush=True)
        yield row, answers


def keep(file: Path, key: tuple, answer: dict) -> None:
    """Append an answer."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("a") as out:
        out.write(json.dumps(dict(zip(("revision", "row", "number", "seed"), key, strict=True)) | answer) + "\n")


def cells(answers: list[dict]) -> list[str]:
    """Return the columns of one side."""
    good = [a for a in answers if "failed" not in a]
    if not good:
        return ["failed", *[""] * 7]
    failed, n = len(answers) - len(good), len(good)
    right, absent = sum(a["right"] for a in good), good[0]["absent"]
    sure = [bool(a["inside"]) for a in good if a["status"] == "recognized"]
    return [
        f"{right}/{n}" + (f", {failed} failed" if failed else ""),
        "" if absent else f"{sum(a['among'] for a in good)}/{n}",
        f"{np.mean([a['P'] for a in good]):.3f} / {0 if absent else right / n:.3f}",
        consistency([a for a in good if a["right"] and a["nees"] is not None]),
        "" if absent or not sure else f"{100 * np.mean(sure):.1f} % of {len(sure)}",
        f"{np.mean([a['unknown'] for a in good]):.3f}",
        *(f"{f([a['ms'] for a in good]):.3g}" for f in (np.median, np.max)),
    ]


def consistency(answers: list[dict]) -> str:
    """Mean and median NEES per degree of freedom; the mean's chi-square interval is Wilson and Hilferty's (1931)."""
    if not answers:
        return ""
    each, total = [a["nees"] / a["dof"] for a in answers], sum(a["dof"] for a in answers)
    mean, median = np.mean(each), np.median(each)
    low, high = ((1 - 2 / (9 * total) + z * np.sqrt(2 / (9 * total))) ** 3 for z in (-1.95996, 1.95996))
    return f"{mean:.3g} ({median:.2f}), {'' if low <= mean <= high else 'not '}in {low:.2f} to {high:.2f}"


def ratio(first: list[dict], other: list[dict]) -> str:
    """Median and worst time over those of the first side."""
    a, b = ([x["ms"] for x in answers if "failed" not in x] for answers in (first, other))
    return f"{np.median(b) / np.median(a):.3g}, {np.max(b) / np.max(a):.3g}" if a and b else ""


def differing(answers: list[list[dict]]) -> int:
    """Scenes of which the sides drew different readings."""
    pairs = [[a["check"] for a in each if "check" in a] for each in zip(*answers, strict=True)]
    return sum(len(p) > 1 and abs(p[0] - p[-1]) > 1e-9 * (1 + abs(p[0])) for p in pairs)


def table(sides: list[Side], rows: dict[str, int], options: argparse.Namespace) -> Table:
    """Return the whole table."""
    lines, differ = [], 0
    for row, answers in run(sides, rows, options):
        differ += differing(answers)
        for s, side in enumerate(sides):
            times = ratio(answers[0], answers[s]) if s else ""
            lines.append(("" if s else row, side.name, *cells(answers[s]), times))
    facts = [f"\nSeed {options.seed}; {', '.join(f'{side.name} is {side.revision}' for side in sides)}."]
    facts += ["Some answers and their times are kept ones, of another run."] if options.kept else []
    facts += [f"**The readings of {differ} scenes differ between the sides.**"] if differ else []
    return Table("Side by side", TEXT.format(" ".join(facts)), COLUMNS, lines)


def chosen(names: list[str], count: int | None) -> dict[str, int]:
    """Return rows and their counts; a name that is no row selects all that begin with it, ``NAME=N`` sets a count."""
    counts = {name: own or 0 for name, _, own in (text.partition("=") for text in names)}
    unknown = [name for name in counts if not any(row.startswith(name) for row in ROWS)]
    if unknown:
        raise SystemExit(f"--rows: expected some of {', '.join(ROWS)}, got {', '.join(unknown)}.")
    out = {}
    for row, (_, usual) in ROWS.items():
        mine = [own for name, own in counts.items() if name == row or (name not in ROWS and row.startswith(name))]
        if (mine or not counts) and (BRACKET.is_file() or not row.startswith("bracket_")):
            out[row] = int((mine or [0])[0]) or count or usual
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("sides", nargs="+", help="one or two commits, or . for the working tree")
    parser.add_argument("--rows", nargs="+", default=[], help="kinds of scenes: touch, touch=48, hard (all hard_*)")
    parser.add_argument("--count", type=int, help="scenes of each row, instead of the usual number")
    parser.add_argument("--seed", type=int, default=1991)
    parser.add_argument("--block", type=int, default=5, help="scenes before it is the other side's turn")
    parser.add_argument("--keep", type=Path, help="a file to which every answer is appended (JSON lines)")
    parser.add_argument("--from", type=Path, nargs="+", default=[], dest="kept", help="files of kept answers to use")
    parser.add_argument("--cache", type=Path, default=CACHE, help="where environments are")
    parser.add_argument("--build", action="store_true", help="build the environments, and no more")
    options = parser.parse_args()
    if len(options.sides) > 2:
        parser.error("expected one side or two")
    sides = [side_of(text, options.cache) for text in options.sides]
    if options.build:
        print("\n".join(f"{side.revision}: {side.python}" for side in sides))
        return
    try:
        print(f"{machine()}\n\n{table(sides, chosen(options.rows, options.count), options).markdown()}")
    finally:
        for side in sides:
            side.stop()


if __name__ == "__main__":
    main()
