"""FMI interface of components: base class, declarations of variables, model description."""
