"""Objects that another process is sent once, however many calls refer to them."""


class SentOnce:
    """Base of dataclasses whose objects are large and common to many calls, such as FMUs."""
