"""The best sequence of states."""
