"""Backups of KRC controllers: what they say of arm, tools, bases and home, and of a cell."""

from postproc.backup.cellvalues import cell_values
from postproc.backup.compare import BackupComparison, Difference, compare
from postproc.backup.controller import read_backup
