"""Import of Matplotlib without the docstrings that it composes meanwhile."""

from __future__ import annotations

from typing import Any


def import_matplotlib() -> None:
    """Import Matplotlib for a program that nobody asks for help on Matplotlib's classes.

    On import it lists the properties of each of its hundred classes in the signature and docstring
    of `set`, in two fifths of its time. The command needs neither. Nothing but these is missing
    afterwards; where Matplotlib is imported already, nothing happens.
    """
    from matplotlib import artist

    base: Any = artist.Artist
    compose = base.__dict__.get("_update_set_signature_and_docstring")
    describe = artist.kwdoc
    if compose is None:
        return
    base._update_set_signature_and_docstring = classmethod(lambda _: None)
    artist.kwdoc = lambda _: ""
    try:
        import matplotlib.axes
        import matplotlib.backends.backend_agg
        import matplotlib.figure  # noqa: F401
    finally:
        base._update_set_signature_and_docstring = compose
        artist.kwdoc = describe
