"""A plan to the program text of one controller."""
