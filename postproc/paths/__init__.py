"""From executed motions to joint paths, moments and times."""
