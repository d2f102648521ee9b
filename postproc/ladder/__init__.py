"""The cheapest way through a graph of rungs, checked as little as possible; knows no robot."""

from postproc.arrays import NONE
from postproc.ladder.free_path import Failing, Found, Steps, free_path
from postproc.ladder.graph import Joined, Rule, Tolls
from postproc.ladder.ladder import Ladder
