"""Separate the arguments of ROS (``--ros-args``) from those of ``tanteo ros``, and read parameters as options."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from tanteo.cli.misuse import MisuseError

ROS_ARGS: ContextVar[tuple[str, ...]] = ContextVar("ROS_ARGS", default=())
"""Arguments that are passed to ROS: namespace, remappings, log level and parameters that are no options."""

_LENGTHS = ("sd", "form_sd", "bias_sd", "standoff", "radius", "goal")
_TIMES = ("latency", "patience", "max_age", "every")
_TEXTS = (
    "parts", "table", "rests", "box", "pose_prior", "prior", "furniture", "noise_factor", "units", "sensor", "robot",
    "tip_sd", "rig", "outlier_rate", "unknown_prior", "max_measurements", "seed", "topic", "topics", "world",
    "direction", "part_frame",
)  # fmt: skip
_FLAGS = {"once": "once", "sim_time": "sim-time", "use_sim_time": "sim-time", "verbose": "verbose"}


def without_ros_args(typed: Sequence[str]) -> list[str]:
    """Return the arguments of a command, and keep those of ROS in :data:`ROS_ARGS`.

    A launch file starts a node with ``--ros-args -r __ns:=/cell -p sd:=0.001``. A parameter with the name of an option
    becomes that option; lengths and times without a unit are in metres and seconds.

    Args:
        typed: all arguments.
    """
    given = list(typed)
    if given[:1] != ["ros"] or "--ros-args" not in given:
        return given
    start = given.index("--ros-args")
    end = given.index("--", start) if "--" in given[start:] else len(given)
    own = list(_options(given[start + 1 : end]))
    options = [word for kind, *words in own if kind == "option" for word in words]
    kept = [word for kind, *words in own if kind == "ros" for word in words]
    ROS_ARGS.set(tuple(kept))
    return [*given[:start], *options, *given[end + 1 :]]


def _options(words: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """Yield each argument of ROS as ``("ros", ..)``, or as ``("option", ..)`` of the command."""
    k = 0
    while k < len(words):
        pair = words[k : k + 2]
        if words[k] in ("-p", "--param") and len(pair) == 2 and ":=" in pair[1]:
            name, _, value = pair[1].partition(":=")
            yield _option(name.rpartition(":")[2], value) or ("ros", *pair)
            k += 2
        elif words[k] == "--params-file" and len(pair) == 2:
            yield "ros", *pair
            for name, value in _parameters_of(pair[1]).items():
                for one in value if isinstance(value, list) else [value]:
                    yield _option(name, str(one)) or ("option",)
            k += 2
        else:
            yield "ros", words[k]
            k += 1


def _parameters_of(path: str) -> dict[str, Any]:
    """Return the parameters of all nodes in a file, as launch files write them.

    Args:
        path: file (YAML) with ``ros__parameters``.

    Raises:
        MisuseError: the file cannot be read.
    """
    try:
        import yaml

        content = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except ImportError:
        raise MisuseError("--params-file: expected the package PyYAML, got none. Install it.") from None
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise MisuseError(f"--params-file: expected parameters (YAML) in {path}, got: {str(error)[:200]}.") from None
    nodes = content.values() if isinstance(content, dict) else ()
    found = [node["ros__parameters"] for node in nodes if isinstance(node, dict) and "ros__parameters" in node]
    return {str(name): value for one in found if isinstance(one, dict) for name, value in one.items()}


def _option(name: str, value: str) -> tuple[str, ...] | None:
    """Return the option that a parameter means; None if there is none of this name."""
    if name in _FLAGS:
        return ("option", f"--{_FLAGS[name]}") if value.lower() == "true" else ("option",)
    text = typed_value(name, value)
    return None if text is None else ("option", f"--{name.replace('_', '-')}".replace("--topics", "--topic"), text)


def typed_value(name: str, value: str) -> str | None:
    """Return the value of a parameter as it would be typed as an option; None if no option has this name.

    Args:
        name: name of the parameter.
        value: value; a length or time without a unit is in metres or seconds.
    """
    unit = "m" if name in _LENGTHS else "s" if name in _TIMES else "" if name in _TEXTS else None
    if unit is None:
        return None
    try:
        float(value)
    except ValueError:
        unit = ""
    return value.strip("'\"") + unit
