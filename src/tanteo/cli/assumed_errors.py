"""Define the options of errors that answers, sessions and plans assume unless they are stated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tanteo.cli import arguments as args

if TYPE_CHECKING:
    from tanteo.cli.error_options import Errors


@dataclass(frozen=True, slots=True, kw_only=True)
class AssumedErrors:
    """Options of the scale error, the drift and the warp, each of which replaces the assumed error."""

    scale_sd: args.ScaleSd = None
    drift_sd: args.DriftSd = None
    warp_sd: args.WarpSd = None

    @property
    def stated_errors(self) -> Errors:
        """Errors that are stated."""
        return tuple(error for errors in (self.scale_sd, self.drift_sd, self.warp_sd) for error in errors or ())
