"""What the process asks of planning and verification alike: order of holes, points served, tilt."""
