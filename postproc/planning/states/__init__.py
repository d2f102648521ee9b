"""Which robot states serve a tag and what each costs."""
