"""Initial poses of maximizations: proposers, their registry, and tables that bound the evidence of many parts."""

from tanteo.posterior.proposals.built_in import FactorPoses
from tanteo.posterior.proposals.drawn import PriorSamples
from tanteo.posterior.proposals.proposer import BITS, InitialPoses, Proposer, SearchState
from tanteo.posterior.proposals.registry import PROPOSERS, proposers

__all__ = ["BITS", "PROPOSERS", "FactorPoses", "InitialPoses", "PriorSamples", "Proposer", "SearchState", "proposers"]
