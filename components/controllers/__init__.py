"""Controllers: from tracking errors to yaw moment."""
