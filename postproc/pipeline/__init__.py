"""Read, place, plan, check, emit, read back: pure functions without printing."""
