"""Fitting effects to rows: linear algebra, registration, noise, evidence."""
