"""Built-in objectives: what a pose of a tag is worth."""
