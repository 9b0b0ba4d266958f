"""Implement ``tanteo cache``: the folder of parts that were read before."""

from __future__ import annotations

from tanteo.cli import arguments as args
from tanteo.cli.printing import emit, put_json


def show(json: args.Json = False) -> None:
    """Show the folder of the cache, its size and its limit."""
    from tanteo.catalogue.cache import cache_folder, cache_limit, cache_size

    size, limit = cache_size(), cache_limit()
    if json:
        put_json(
            {
                "schema": "tanteo.cache/1",
                "folder": str(cache_folder()),
                "parts": size.parts,
                "entries": size.entries,
                "bytes": size.bytes,
                "limit_bytes": limit,
            }
        )
        return
    emit(
        [
            f"{cache_folder()}: {size.parts} parts, {size.bytes / 1e6:.1f} of at most {limit / 1e6:.0f} MB",
            "Above the limit the entries that were not used for the longest time are deleted. "
            "TANTEO_CACHE_LIMIT=500MB sets another limit, TANTEO_CACHE=FOLDER another folder.",
        ]
    )


def clear(json: args.Json = False) -> None:
    """Delete all entries of the cache; parts are then read from their files again."""
    from tanteo.catalogue.cache import cache_folder, clear_cache

    gone = clear_cache()
    if json:
        document = {"schema": "tanteo.cache_cleared/1", "folder": str(cache_folder())}
        put_json({**document, "parts": gone.parts, "entries": gone.entries, "bytes": gone.bytes})
        return
    emit([f"{cache_folder()}: {gone.parts} parts deleted, {gone.bytes / 1e6:.1f} MB"])
