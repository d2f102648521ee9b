"""Backups of KRC controllers: what they say of arm, tools, bases and home, and of a cell."""

from postproc.backup.cellvalues import cell_values
from postproc.backup.compare import BackupComparison, compare
from postproc.backup.compare_external import Difference
from postproc.backup.controller import read_backup
