"""tanteo: which part is it, where is it, and how sure are we."""

__version__ = "0.1.0"
