"""Real controllers as a test: what lint says of them, and archives that were made to harm.

``python -m tools.controllers lint FOLDER...`` prints the findings of lint in backups and programs,
by code with a judgement each, and the share of files without a false error;
``python -m tools.controllers mutate ARCHIVE [COUNT]`` reads so many damaged copies of a backup.
"""
