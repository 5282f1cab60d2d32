"""`pendsus plot`: redraw from a results file alone."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import click

from suspension_cli.analyses import options, settings
from suspension_cli.cli import terminal
from suspension_cli.cli.runner import Command

FILES = options.argument("files", nargs=-1, required=True, metavar="FILE.h5...")


@click.command("plot", cls=Command, params=[FILES, options.BESIDE, options.QUIET])
def command(files: tuple[str, ...], out: str | None, quiet: bool) -> None:
    """Redraw the picture of each results FILE, from the file alone.

    Example: pendsus plot results/my-modes.h5
    """
    from pathlib import Path

    from suspension_cli.analyses import registry
    from suspension_cli.drawing.style import to_png
    from suspension_cli.files.atomic import write_bytes
    from suspension_cli.files.hdf5 import open_results

    for file in files:
        with _attributing_errors_to(file), open_results(file) as results:
            picture = to_png(registry.loaded(results, file).plot())
        path = (settings.folder(out) if out else Path(file).parent) / f"{Path(file).stem}.png"
        write_bytes(path, picture, key="--out" if out else "")
        if not quiet:
            terminal.tell(f"wrote {path}")


@contextlib.contextmanager
def _attributing_errors_to(file: str) -> Iterator[None]:
    """Report whatever goes wrong as a fault of the file, which is all that is drawn from."""
    import warnings

    from suspension_cli.errors import Fault, InputError, attribute_faults_to
    from suspension_cli.files.hdf5 import one_line

    again = "run the analysis again"
    with attribute_faults_to(file), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of numbers that are not finite
        try:
            yield
        except (InputError, MemoryError):
            raise
        except KeyError as error:
            raise InputError([Fault("", f"is incomplete: {error.args[0]}", again)]) from None
        except Exception as error:
            raise InputError(
                [
                    Fault(
                        "",
                        f"cannot be drawn, as its contents are inconsistent ({one_line(error)})",
                        again,
                    )
                ]
            ) from None
