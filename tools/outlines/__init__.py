"""Outlines of the built-in arms, measured on the meshes of KUKA's ROS packages.

``python -m tools.outlines measure PACKAGES`` writes ``postproc/collision/outlines.json``;
``python -m tools.outlines table PACKAGES`` prints how far the real bodies stand out of ours;
``python -m tools.outlines held-out PACKAGES OTHERS`` the same for outlines made without each arm,
and for arms of OTHERS (ros-industrial/kuka_experimental) that were not measured;
``python -m tools.outlines picture PACKAGES FILE.png NAME...`` draws ours beside the real ones.
PACKAGES is a checkout of kroshu/kuka_robot_descriptions (Apache-2.0) with its meshes.
"""
