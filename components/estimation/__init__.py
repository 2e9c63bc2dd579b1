"""Code shared by estimators: reference speed, zero points, single-track Kalman filter."""
