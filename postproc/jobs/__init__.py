"""What commands do from start to end: convert, sample, check a cell, measure next."""
