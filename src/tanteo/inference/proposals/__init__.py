"""Where maximizations start: one proposer a file, tables that bound many parts, and the registry of proposers."""

from tanteo.inference.proposals.built_in import FactorPoses
from tanteo.inference.proposals.drawn import PriorSamples
from tanteo.inference.proposals.proposer import BITS, InitialPoses, Proposer, SearchState
from tanteo.inference.proposals.registry import PROPOSERS, proposers

__all__ = ["BITS", "PROPOSERS", "FactorPoses", "InitialPoses", "PriorSamples", "Proposer", "SearchState", "proposers"]
