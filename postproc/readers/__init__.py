"""CAM files to ToolPath; one format per file, found by the registry."""
