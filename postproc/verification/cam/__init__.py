"""The executed path held against the CAM file: points, arcs, holes, feeds, events, tilt."""
