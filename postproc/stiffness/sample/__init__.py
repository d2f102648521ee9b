"""Where to measure: plans for a stiffness campaign."""
