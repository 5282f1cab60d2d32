"""Import of Matplotlib without composing docstrings."""

from __future__ import annotations

import gc
from typing import Any


def import_matplotlib() -> None:
    """Import Matplotlib without the docstrings of `set`, in three fifths of its time.

    On import it lists the properties of each of its hundred classes in the signature and docstring
    of `set`, which no command needs. Nothing else is missing afterwards. Does nothing if Matplotlib
    is imported already.
    """
    from matplotlib import artist

    base: Any = artist.Artist
    compose = base.__dict__.get("_update_set_signature_and_docstring")
    describe = artist.kwdoc
    if compose is None:
        return
    base._update_set_signature_and_docstring = classmethod(lambda _: None)
    artist.kwdoc = lambda _: ""
    collecting = gc.isenabled()
    gc.disable()  # nearly all that an import makes stays
    try:
        import matplotlib.axes
        import matplotlib.backends.backend_agg
        import matplotlib.figure  # noqa: F401
    finally:
        base._update_set_signature_and_docstring = compose
        artist.kwdoc = describe
        if collecting:
            gc.enable()
