"""Where maximizations start: one proposer a file, tables that bound many parts, and the registry of proposers."""

from tanteo.inference.proposals.built_in import FactorPoses
from tanteo.inference.proposals.drawn import PriorSamples
from tanteo.inference.proposals.proposer import BITS, EXHAUSTIVE, InitialPoses, Proposer, SearchState
from tanteo.inference.proposals.registry import PROPOSERS, proposers

__all__ = [
    "BITS", "EXHAUSTIVE", "PROPOSERS", "FactorPoses", "InitialPoses", "PriorSamples", "Proposer", "SearchState",
    "proposers",
]  # fmt: skip
