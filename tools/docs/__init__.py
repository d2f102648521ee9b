"""What the documentation is built from besides its pages: reference, figures, example files."""
