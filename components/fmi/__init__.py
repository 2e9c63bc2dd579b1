"""Base class of components, declarations of their variables, and their FMI interface."""
