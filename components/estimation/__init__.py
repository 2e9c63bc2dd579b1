"""Code shared by estimators: reference speed, zero points, the filter on a single track."""
