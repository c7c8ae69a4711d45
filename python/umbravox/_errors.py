"""Exceptions with the words of the command line."""


class Error(Exception):
    """What could not be done (``what``), where (``place``), why, and where there is one a way out (``hint``)."""

    def __init__(self, what, place, why, hint=None):
        super().__init__(what, place, why, hint)
        self.what, self.place, self.why, self.hint = what, place, why, hint

    def __str__(self):
        hint = f"\nhint: {self.hint}" if self.hint else ""
        return f"{self.what} ({self.place}): {self.why}{hint}"


class InputError(Error, ValueError):
    """The input is at fault: a file, an array or an argument."""


class RunError(Error, RuntimeError):
    """Something failed while running: no adapter, a lost device, a full disk."""


for _class in (Error, InputError, RunError):
    # As they are imported, also where they are pickled.
    _class.__module__ = "umbravox"
del _class
