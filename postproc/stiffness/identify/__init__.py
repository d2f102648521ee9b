"""Joint stiffness from measured deflections."""
