"""Controllers: from tracking error to yaw moment."""
