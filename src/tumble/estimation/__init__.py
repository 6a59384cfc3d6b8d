"""Adjustment of condition equations: Gauss-Helmert, variance components, reliability.

This room knows no IMU. Conditions ``f(observations, parameters) = 0`` come in groups along a chain
(one group a hold, with the turn that follows it), each group correlated with its neighbours at most:
cost grows linearly with the number of groups.
"""

from tumble.estimation.block_chain import BlockChain
from tumble.estimation.gauss_helmert import Adjustment, Conditions, Linearisation, Prior, adjust
from tumble.estimation.reliability import GroupTest, Reliability, critical_value, snoop_groups
from tumble.estimation.weak_directions import WeakDirection, find_weak_directions

__all__ = [
    "Adjustment",
    "BlockChain",
    "Conditions",
    "GroupTest",
    "Linearisation",
    "Prior",
    "Reliability",
    "WeakDirection",
    "adjust",
    "critical_value",
    "find_weak_directions",
    "snoop_groups",
]
