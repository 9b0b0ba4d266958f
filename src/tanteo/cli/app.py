"""Connect the commands to the parser: parse their options, and turn errors into messages and exit codes.

This module and those of the commands import only the parser at start. Each command imports the rest when it runs.
"""

from __future__ import annotations

import inspect
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import is_dataclass
from typing import Annotated, Any, NamedTuple, NoReturn, get_type_hints

import typer
from typer.core import TyperCommand

from tanteo.cli import (  # fmt: skip
    answer,
    bench,
    cache,
    calibrate,
    catalogue,
    cell,
    demo,
    doctor,
    following,
    part,
    plan,
    probe,
    replay,
    ros,
    see,
    sense,
    sense_part,
    sensor,
    view,
)
from tanteo.cli.help_examples import EXAMPLES
from tanteo.cli.misuse import MisuseError, misuse
from tanteo.cli.printing import complain, listening, put_json
from tanteo.cli.typed import Words
from tanteo.errors import InputError, TanteoError
from tanteo.plugins import PluginWarning

_FAILED, _MISUSED, _INTERRUPTED = 1, 2, 130

_MANY = ("--parts", "--discriminate")
_READINGS_SUFFIXES = (
    ".csv", ".txt", ".json", ".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".log", ".tsv", ".asc", ".xyz", ".pts",
    ".pcd", ".probe", ".qif", ".dmi", ".dms", ".dmo", ".ls", ".va", ".dat", ".src", ".mod", ".script",
    ".bag", ".mcap", ".db3",
)  # fmt: skip


_FIRST, _LAST = ("Arguments", "Readings and parts", "Options"), ("Answer", "Output", "File of readings")
"""Groups of options that a help text shows before and after all others."""


class Grouped(TyperCommand):
    """Command whose help lists its options in groups, and shows an example that runs in the repository."""

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Return the arguments of the usage line: names, in brackets if they are optional.

        Args:
            ctx: context of the parser.
        """
        pieces = super().collect_usage_pieces(ctx)
        return [re.sub(r"^\[\[(.*?)(?:\.\.\.)?\]\]|^\{(.*?)(?:\.\.\.)?\}", _bare, one) for one in pieces]

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write groups of options: files first, then those of the command, then those that all commands share.

        Args:
            ctx: context of the parser.
            formatter: writer of the help text.
        """
        groups: dict[str, list[tuple[str, str]]] = {}
        for parameter in self.get_params(ctx):
            record = parameter.get_help_record(ctx)
            if record is not None:
                argument = parameter.param_type_name == "argument"
                name = "Arguments" if argument else getattr(parameter, "rich_help_panel", None) or "Options"
                name = "Output" if parameter.name == "help" else name
                typed = re.sub(r" <(?:int|float)>$", " NUMBER", record[0])
                groups.setdefault(name, []).append((re.sub(r" <[^<]*>$", "", typed), record[1]))
        others = [name for name in groups if name not in _FIRST + _LAST]
        for name in (*_FIRST, *others, *_LAST):
            if name in groups:
                with formatter.section(name):
                    formatter.write_dl(groups[name])

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Write the example unchanged.

        Args:
            ctx: context of the parser.
            formatter: writer of the help text.
        """
        if self.epilog:
            with formatter.section("Example"):
                formatter.write("".join(f"  {line}\n" for line in self.epilog.splitlines()))


def _bare(found: re.Match[str]) -> str:
    """Return an optional argument in brackets, and a required one without."""
    return f"[{found[1]}]" if found[1] else found[2]


@contextmanager
def _guarded(*, as_json: bool = False) -> Iterator[None]:
    """Turn the errors of tanteo inside the context into a line on standard error and an exit code.

    Args:
        as_json: whether the output is a JSON document, which then states the error.
    """
    try:
        with listening(), _plugin_warnings():
            yield
    except TanteoError as error:
        misused = isinstance(error, MisuseError)
        _fail(_MISUSED if misused else _FAILED, type(error).__name__, str(error), as_json=as_json)
    except KeyboardInterrupt as error:
        message = " ".join(["interrupted.", *getattr(error, "__notes__", ())])
        _fail(_INTERRUPTED, type(error).__name__, message, as_json=as_json)


def _fail(exit_code: int, kind: str, message: str, *, as_json: bool) -> NoReturn:
    complain("error", message)
    if as_json:
        with suppress(InputError):  # standard output cannot be written: that may be the error
            put_json({"schema": "tanteo.error/1", "exit_code": exit_code, "kind": kind, "message": message})
    raise typer.Exit(exit_code) from None


@contextmanager
def _plugin_warnings() -> Iterator[None]:
    """Print warnings about plug-ins as the warnings of a command."""
    with warnings.catch_warnings():
        show = warnings.showwarning

        def complain_of(message: Any, category: type[Warning], *where: Any, **more: Any) -> None:
            if issubclass(category, PluginWarning):
                complain("warning", str(message))
            else:
                show(message, category, *where, **more)

        warnings.simplefilter("always", PluginWarning)
        warnings.showwarning = complain_of
        yield


class _Option(NamedTuple):
    """Option of a command.

    Attributes:
        parameter: parameter in the form of the parser.
        words: conversion of the typed value; None for none.
        group: name of the dataclass of options that has it as a field; empty for none.
    """

    parameter: inspect.Parameter
    words: Words | None
    group: str


def _options(owner: Any, group: str = "") -> Iterator[_Option]:
    """Yield the options of a command, or of a dataclass of options."""
    annotations = get_type_hints(owner, include_extras=True)
    for parameter in inspect.signature(owner).parameters.values():
        annotation = annotations[parameter.name]
        if is_dataclass(annotation):
            yield from _options(annotation, parameter.name)
            continue
        words = next((extra for extra in annotation.__metadata__ if isinstance(extra, Words)), None)
        default = parameter.default
        if words is not None:
            option = next(extra for extra in annotation.__metadata__ if extra is not words)
            annotation = Annotated[words.typed, option]
            default = default if words.default is None else words.default
        parameter = parameter.replace(annotation=annotation, default=default, kind=inspect.Parameter.KEYWORD_ONLY)
        yield _Option(parameter, words, group)


def _command(function: Callable[..., None], check: Callable[[Mapping[str, Any]], None] | None) -> Callable[..., None]:
    """Return a command in the form of the parser.

    Args:
        function: function of the command; a parameter that is a dataclass has options as its fields.
        check: function that receives all typed values by parameter name, before they are converted; None for none.
    """
    options = list(_options(function))
    groups = {name: annotation for name, annotation in get_type_hints(function).items() if is_dataclass(annotation)}

    def run(**typed: Any) -> None:
        with _guarded(as_json=typed.get("json") is True):
            with misuse():
                if check is not None:
                    check(typed)
                values: dict[str, dict[str, Any]] = {name: {} for name in ("", *groups)}
                for option in options:
                    value = typed[option.parameter.name]
                    if option.words is not None and value is not None:
                        value = option.words.read(value)
                    values[option.group][option.parameter.name] = value
                made = {name: group(**values[name]) for name, group in groups.items()}  # type: ignore[operator]
            function(**values[""], **made)

    run.__signature__ = inspect.Signature([option.parameter for option in options])  # type: ignore[attr-defined]
    run.__doc__ = function.__doc__
    run.__annotations__ = {option.parameter.name: option.parameter.annotation for option in options}
    return run


def _group(words: str) -> typer.Typer:
    return typer.Typer(help=words, rich_markup_mode=None, no_args_is_help=True)


def _add(to: typer.Typer, name: str, function: Callable[..., None], check: Any = None) -> None:
    example = EXAMPLES.get(f"{function.__module__.rpartition('.')[2]}.{function.__name__}")
    to.command(name, cls=Grouped, epilog=example)(_command(function, check))


def _version(wanted: bool) -> None:
    if wanted:
        from tanteo import __version__

        typer.echo(f"tanteo {__version__}")
        raise typer.Exit


app = typer.Typer(
    help="Recognize and locate CAD parts from touches and ranges, with probabilities and covariances.",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    no_args_is_help=True,
    epilog="Exit codes: 0 answered, 1 failed, 2 misused, 3 ambiguous, unknown or insufficient.",
)


@app.callback()
def root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Recognize and locate CAD parts from touches and ranges, with probabilities and covariances."""


_sense = _group("Sense a feature or a part in the simulator, without contact.")
_sensor = _group("Show sensors, robots and rigs, and calibrate them.")
_calibrate = _group("Calibrate a camera on the hand.")
_part = _group("Show the content of CAD files.")
_cache = _group("Show the cache of CAD files, and empty it.")
_catalogue = _group("Store many parts on disk, prepared for recognition.")

_add(app, "identify", answer.identify)
_add(app, "locate", answer.locate)
_add(app, "see", see.see)
_add(app, "next", following.next_reading)
_add(app, "plan", plan.plan, plan.check_plan)
_add(app, "probe", probe.probe)
_add(app, "ros", ros.ros)
_add(app, "check-cell", cell.check_cell)
app.add_typer(_sense, name="sense")
_add(_sense, "plane", sense.sense_plane)
_add(_sense, "edge", sense.sense_edge)
_add(_sense, "vertex", sense.sense_vertex)
_add(_sense, "circle", sense.sense_circle)
_add(_sense, "cylinder", sense.sense_cylinder)
_add(_sense, "part", sense_part.sense_part)
_add(app, "view", view.view, view.check_view)
_add(app, "replay", replay.replay)
app.add_typer(_sensor, name="sensor")
_add(_sensor, "list", sensor.list_presets)
_add(_sensor, "show", sensor.show_preset)
_add(_sensor, "rig", sensor.show_rig)
_add(_sensor, "fit", sensor.fit)
app.add_typer(_calibrate, name="calibrate")
_add(_calibrate, "hand-eye", calibrate.hand_eye)
app.add_typer(_part, name="part")
_add(_part, "show", part.show)
app.add_typer(_catalogue, name="catalogue")
_add(_catalogue, "build", catalogue.build)
_add(_catalogue, "add", catalogue.add)
_add(_catalogue, "show", catalogue.show)
_add(_catalogue, "check", catalogue.check)
app.add_typer(_cache, name="cache")
_add(_cache, "show", cache.show)
_add(_cache, "clear", cache.clear)
_add(app, "bench", bench.bench)
_add(app, "demo", demo.demo)
_add(app, "doctor", doctor.doctor)


def spread_values(argv: Sequence[str]) -> list[str]:
    """Return arguments in which ``--parts A B C`` is ``--parts A --parts B --parts C``, as the parser requires.

    The values end at the next option. They also end at a readings file (``.csv``), a record (``.json``) or an image,
    which is never a part; these may therefore follow the parts.

    Args:
        argv: arguments as typed.
    """
    out: list[str] = []
    many = ""
    for k, word in enumerate(argv):
        if word == "--":
            return out + list(argv[k:])
        fresh = bool(out) and out[-1] in _MANY
        if word.startswith("-") and len(word) > 1:
            many = word if word in _MANY else ""
        elif many and not fresh:
            if word.lower().endswith(_READINGS_SUFFIXES):
                many = ""
            else:
                out.append(many)
        out.append(word)
    return out
