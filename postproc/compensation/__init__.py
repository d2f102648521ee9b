"""Commands moved so that the loaded real tool lands on the CAM points."""
