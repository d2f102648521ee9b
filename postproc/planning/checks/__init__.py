"""Which states and motions are allowed, and why not."""
