"""The live page: a session as it happens, in a browser, for people who look on, or sense themselves.

A session at a moment is a :class:`Snapshot`; ``drawing`` makes primitives of it and ``panel`` words, both without a
browser. :class:`Player` plays a :class:`Show` on anything that implements :class:`Page`; :func:`play` and
:func:`replay` open viser's (extra ``viewer``), which is imported then.
"""
