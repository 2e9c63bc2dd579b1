"""The units' models: pure physics and control laws behind thin FMI classes."""
