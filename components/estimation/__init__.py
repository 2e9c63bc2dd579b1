"""What estimators share: reference speed, zero points, the filter on a single track."""
