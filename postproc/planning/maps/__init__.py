"""What every spin about the tool axis would mean at every tag, for pages and tables."""
