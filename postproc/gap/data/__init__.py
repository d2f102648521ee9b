"""The rows of a campaign as the fit sees them, and the arm's model."""
