"""Which effects are adopted, and the verdict."""
