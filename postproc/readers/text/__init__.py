"""Text input at speed: blocks, numbers, spans, collected faults."""
