"""The live page: a session as it happens, in a browser, for people who look on, or sense themselves.

A session at a moment is a :class:`Snapshot`; ``drawing`` makes primitives of it and ``panel`` words, both without a
browser. :class:`Player` plays a :class:`Show` on anything that implements :class:`Page`; :func:`play` and
:func:`replay` open viser's (extra ``viewer``), which is imported then.
"""

from tanteo.viewer.commands import Advance, AnswerNow, Choose, Click, Contest, Go, Pause, Quit, Restart
from tanteo.viewer.player import Page, Player
from tanteo.viewer.scenes import scene_show
from tanteo.viewer.shows import Show, Watch, hand_show, laser, probe_show, simulated
from tanteo.viewer.snapshot import Snapshot
from tanteo.viewer.view import NEEDS_VISER, follow, moments, play, replay, show_moment

__all__ = [
    "NEEDS_VISER", "Advance", "AnswerNow", "Choose", "Click", "Contest", "Go", "Page", "Pause", "Player", "Quit",
    "Restart", "Show", "Snapshot", "Watch", "follow", "hand_show", "laser", "moments", "play", "probe_show", "replay",
    "scene_show", "show_moment", "simulated",
]  # fmt: skip
