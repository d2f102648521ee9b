"""The diagnosis and what follows from it: document, where, next poses, prediction."""
