"""Results as labelled arrays: the contents of a results file as an `xarray.Dataset`."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from suspension_cli.files.declared import SI
from suspension_cli.files.hdf5 import open_results, read_contents

if TYPE_CHECKING:
    import xarray

    from suspension_cli.files.declared import Contents


@contextlib.contextmanager
def contents_of(result: Any) -> Iterator[Contents]:
    """Open the contents of an `analysis.Result`: of its file, or as its file would have them."""
    stored = result.stored_file()
    if stored is not None:
        with open_results(stored) as file:
            yield read_contents(file[result.analysis.name])
    else:
        yield result.analysis.contents(result)


def to_xarray(result: Any) -> xarray.Dataset:
    """Convert an `analysis.Result`; dimensions and coordinates are the scales of its file.

    Numbers have their `units`, unless these differ between the elements of an array: the array that
    has them is then named by `units_in`. Attributes name design, model and estimated error.
    """
    import xarray  # pyright: ignore[reportMissingImports]

    variables = {}
    with contents_of(result) as contents:
        for path, one in contents.variables.items():
            attributes = {} if one.is_text or one.unit == SI else {"units": one.unit}
            if "{" in one.unit:
                attributes = {"units_in": one.unit}
            variables[_dotted(path)] = ([*map(_dotted, one.dims)], one.read(), attributes)
    about = {
        "design": result.name,
        "model": result.model,
        "estimated_error": result.estimated_error,
    }
    return xarray.Dataset(variables, attrs=about)


def _dotted(path: str) -> str:
    """A path within a group as the name of a variable."""
    return path.replace("/", ".")
