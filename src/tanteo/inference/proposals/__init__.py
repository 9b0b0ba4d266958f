"""Where maximizations start: one proposer a file, tables that bound many parts, and the registry of proposers."""

from tanteo.inference.proposals.drawn import PriorSamples
from tanteo.inference.proposals.proposer import BITS, EXHAUSTIVE, InitialPoses, Proposer, SearchState
from tanteo.inference.proposals.registry import PROPOSERS, proposers

__all__ = ["BITS", "EXHAUSTIVE", "PROPOSERS", "InitialPoses", "PriorSamples", "Proposer", "SearchState", "proposers"]
