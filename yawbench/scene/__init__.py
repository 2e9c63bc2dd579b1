"""A run in space: car, wheels, lanes, cones, ground and forces; for pages, figures and other viewers.

`scene_of` makes the `Scene` of recorded results. Axes are those of ISO 8855: x forward, y to the left, z up,
with z = 0 on the road; angles turn about z (yaw, steer), y (pitch, nose down), x (roll, left side up).
"""
