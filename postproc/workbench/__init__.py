"""The pages, alive: a local workbench in which a plan is edited while it is looked at."""

from postproc.workbench.bench import Bench
from postproc.workbench.server import Workbench, open_workbench
