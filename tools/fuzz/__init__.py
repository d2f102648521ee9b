"""Random CAM files through the whole of ``convert``: nothing may end in a fault of our own."""
