"""Registries of what other distributions add by entry point: CAD readers, log formats, factors, programs, machines.

Each group of entry points has one :class:`Registry`, which holds the built-in entries, too:

1. The name of an entry point is what the user types: a suffix, a format, a factor, a language, a kind of machine, in
   lower case.
2. Entry points are searched when a name is needed that is not built in, and a plug-in is imported when its own name is
   needed. Only log formats are all imported, to recognise a file of readings.
3. A built-in entry keeps its name: an entry point of the same name is not used.
4. A plug-in that fails raises :class:`tanteo.errors.PluginError` where its name is needed. Elsewhere it is skipped with
   one :class:`PluginWarning`. ``tanteo doctor`` lists all plug-ins with their errors.
"""

from __future__ import annotations

import hashlib
import os
import sys
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Generic, TypeAlias, TypeVar

from tanteo.errors import InputError, PluginError, TanteoError

Entry = TypeVar("Entry")


class PluginWarning(UserWarning):
    """A plug-in was skipped; the message names it and the reason."""


@dataclass(frozen=True, slots=True)
class Plugin:
    """One entry point of another distribution.

    Attributes:
        group: group of the entry point.
        name: name of the entry point, in lower case.
        value: object that the entry point refers to, as ``module:attribute``.
        distribution: name and version of the distribution.
    """

    group: str
    name: str
    value: str
    distribution: str

    def __str__(self) -> str:
        return f"{self.distribution}, entry point '{self.name} = {self.value}' of {self.group}"


Claims: TypeAlias = Mapping[str, tuple[Plugin, ...]]
"""Entry points of one group by name; two of one name contradict each other."""


class Registry(Generic[Entry]):
    """Entries of one group by name: built in, registered by the program, or found by entry point.

    Attributes:
        group: group of entry points.
        builtin: built-in entries by name.
        registered: entries that the program registered in this process, by name.
    """

    def __init__(self, group: str, kind: Any, builtin: Mapping[str, Entry], *, reserved: tuple[str, ...] = ()) -> None:
        """Make a registry.

        Args:
            group: group of entry points.
            kind: type of an entry; a plug-in of another type is refused.
            builtin: built-in entries by name.
            reserved: names with another meaning, which no entry may have.
        """
        self.group, self._kind, self._reserved = group, kind, reserved
        self.builtin: dict[str, Entry] = dict(builtin)
        self.registered: dict[str, Entry] = {}
        self._loaded: dict[Plugin, Entry | PluginError] = {}

    def names(self) -> tuple[str, ...]:
        """Return all names: registered ones, those of plug-ins, built-in ones. No plug-in is imported."""
        return tuple(dict.fromkeys([*self.registered, *self._usable(), *self.builtin]))

    def find(self, name: str) -> Entry | None:
        """Return the entry of a name, or None if there is none.

        Raises:
            PluginError: The plug-in of that name cannot be used.
        """
        for known in (self.registered, self.builtin):
            if name in known:
                return known[name]
        claims = self._usable().get(name, ())
        if len(claims) > 1:
            owners = " and ".join(plugin.distribution for plugin in claims)
            raise PluginError(
                f"'{name}' of {self.group}: expected one plug-in, got those of {owners}. Uninstall all but one."
            )
        return self._load(claims[0]) if claims else None

    def entries(self) -> Iterator[Entry]:
        """Yield all entries that work: registered ones, plug-ins, built-in ones.

        A plug-in that cannot be used is skipped with a warning.
        """
        yield from self.registered.values()
        for name in self._usable():
            if name not in self.registered:
                try:
                    entry = self.find(name)
                except PluginError as error:
                    warn(str(error))
                else:
                    assert entry is not None
                    yield entry
        for plugin in self.plugins():
            if problem := self._hidden(plugin):
                warn(problem)
        yield from (entry for name, entry in self.builtin.items() if name not in self.registered)

    def register(self, name: str, entry: Entry) -> None:
        """Add an entry for this process.

        Raises:
            InputError: The name is taken.
        """
        if name in self._reserved or name in self.names():
            raise InputError(f"{self.group}: expected a new name, got '{name}', which is taken. Choose another.")
        self.registered = {name: entry, **self.registered}

    def plugins(self) -> tuple[Plugin, ...]:
        """Return the entry points of the group; no plug-in is imported."""
        return tuple(plugin for claims in self._found().values() for plugin in claims)

    def origin(self, name: str) -> str:
        """Return the distribution and entry point of a name; empty if it is built in or registered."""
        if name in self.registered or name in self.builtin:
            return ""
        return "; ".join(map(str, self._usable().get(name, ())))

    def fingerprint(self, name: str) -> str | None:
        """Return a text that changes with the code of a plug-in; empty if it is built in, None if it is not known."""
        if name in self.registered:
            return None
        return "|".join(map(_fingerprint, () if name in self.builtin else self._usable().get(name, ())))

    def problem(self, plugin: Plugin) -> str:
        """Import a plug-in, and return one sentence why it is not used; empty if it works."""
        if problem := self._hidden(plugin):
            return problem
        try:
            self.find(plugin.name)
        except PluginError as error:
            return str(error)
        return ""

    def _found(self) -> Claims:
        return _declared(tuple(sys.path)).get(self.group, {})

    def _usable(self) -> Claims:
        return {name: claims for name, claims in self._found().items() if not self._hidden(claims[0])}

    def _hidden(self, plugin: Plugin) -> str:
        if plugin.name not in self.builtin and plugin.name not in self._reserved:
            return ""
        return f"{plugin}: expected a new name, got that of a built-in one, which is used. Rename the entry point."

    def _load(self, plugin: Plugin) -> Entry:
        found = self._loaded.get(plugin)
        if found is None:
            try:
                found = self._imported(plugin)
            except PluginError as error:
                found = error
            self._loaded[plugin] = found
        if isinstance(found, PluginError):
            raise found.with_traceback(None)
        return found

    def _imported(self, plugin: Plugin) -> Entry:
        module, _, attribute = plugin.value.partition(":")
        with guarded(str(plugin), "a plug-in that can be imported"):
            entry: Any = import_module(module.strip())
            for word in filter(None, attribute.split("[")[0].strip().split(".")):
                entry = getattr(entry, word)
        if not isinstance(entry, self._kind):
            raise PluginError(
                f"{plugin}: expected an object of type {self._kind.__name__}, got one of type {type(entry).__name__}. "
                "Repair or uninstall it."
            )
        if isinstance(own := getattr(entry, "name", None), str) and own != plugin.name:
            raise PluginError(f"{plugin}: expected an entry of the same name, got '{own}'. Make the two names equal.")
        return entry


@contextmanager
def guarded(origin: str, expected: str, error: type[TanteoError] = PluginError) -> Iterator[None]:
    """Turn any exception of a plug-in inside the context into one error that names the plug-in.

    No list of exceptions would cover the code of others, so this is the one place that takes them all. Errors of tanteo
    pass through.

    Args:
        origin: name of the plug-in; empty for built-in code, whose exceptions pass through.
        expected: description of what the plug-in should have done.
        error: type of the error to raise.

    Raises:
        PluginError: the code raised an exception that is not one of tanteo, or ``error`` if that is given.
    """
    try:
        yield
    except (TanteoError, MemoryError):
        raise
    except (Exception, SystemExit) as raised:
        if not origin:
            raise
        text = " ".join(str(raised).split())[:300]
        got = f"{type(raised).__name__}: {text}" if text else type(raised).__name__
        raise error(f"{origin}: expected {expected}, got {got}. Repair or uninstall it.") from raised


def warn(message: str) -> None:
    """Warn that a plug-in is skipped, once in a process for each message."""
    if message not in _WARNED:
        _WARNED.add(message)
        warnings.warn(message, PluginWarning, stacklevel=3)


_WARNED: set[str] = set()
_DECLARED: dict[tuple[str, ...], Mapping[str, Claims]] = {}


def _declared(paths: tuple[str, ...]) -> Mapping[str, Claims]:
    """Return the entry points by group and name; they are searched again when ``sys.path`` changes."""
    if paths not in _DECLARED:
        _DECLARED[paths] = _searched() if any(map(_may_declare, paths)) else {}
    return _DECLARED[paths]


def _may_declare(path: str) -> bool:
    """Return whether a place of ``sys.path`` may have entry points of a group of tanteo.

    This reads the files of entry points alone, in a tenth of the time of ``importlib.metadata``, which is imported only
    if one of them names such a group. Archives are left to it.
    """
    if path.endswith(".egg") or os.path.isfile(path):
        return os.path.basename(path) not in _LIBRARY
    try:
        with os.scandir(path or ".") as entries:
            folders = [entry.path for entry in entries if entry.name.endswith((".dist-info", ".egg-info"))]
    except OSError:
        return False
    return any(_is_marked(os.path.join(folder, "entry_points.txt")) for folder in folders)


_LIBRARY = (f"python{sys.version_info[0]}{sys.version_info[1]}.zip",)
"""Archive of Python's own library on ``sys.path``, which has no distributions."""


def _is_marked(file: str) -> bool:
    try:
        with open(file, "rb", buffering=0) as stream:
            return b"[tanteo." in stream.read()
    except OSError:
        return False


def _searched() -> Mapping[str, Claims]:
    from importlib import metadata

    found: dict[str, dict[str, tuple[Plugin, ...]]] = {}
    seen = set[str]()
    for distribution in metadata.distributions():
        text = distribution.read_text("entry_points.txt")
        if text is None or "[tanteo." not in text:
            continue
        name = str(distribution.metadata["Name"] or "a distribution without a name")
        if name not in seen:  # the first on sys.path is the one that Python imports
            seen.add(name)
            _sort_into(found, text, f"{name} {distribution.metadata['Version'] or 'without version'}")
    return found


def _sort_into(found: dict[str, dict[str, tuple[Plugin, ...]]], text: str, distribution: str) -> None:
    """Add the entry points of one distribution; lines that are malformed are passed over."""
    group = ""
    for line in map(str.strip, text.splitlines()):
        if line.startswith("["):
            group = line.strip("[] ")
        elif group.startswith("tanteo.") and "=" in line and not line.startswith(("#", ";")):
            name, value = (word.strip() for word in line.split("=", 1))
            plugin = Plugin(group, name.lower(), value, distribution)
            claims = found.setdefault(group, {})
            claims[plugin.name] = (*claims.get(plugin.name, ()), plugin)


def _fingerprint(plugin: Plugin) -> str:
    """Return a text that changes when a file of the plug-in's package does; nothing of it is imported."""
    from importlib.util import find_spec

    digest = hashlib.sha256()
    try:
        with guarded(str(plugin), "a module"):
            spec = find_spec(plugin.value.partition(":")[0].strip().partition(".")[0])
    except PluginError:
        spec = None
    places = [] if spec is None else [*(spec.submodule_search_locations or ()), spec.origin or ""]
    for place in map(Path, filter(None, places)):
        for file in sorted(place.rglob("*")) if place.is_dir() else [place]:
            if file.is_file() and "__pycache__" not in file.parts:
                known = file.stat()
                digest.update(f"{file}|{known.st_size}|{known.st_mtime_ns}|".encode())
    return f"{plugin}|{digest.hexdigest()}"
