"""`pendsus plot`: redraw from a results file alone."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import click

from suspension_cli.cli import options


@click.command("plot")
@click.argument("files", nargs=-1, required=True, metavar="FILE.h5...")
@options.beside
@click.option("-q", "--quiet", is_flag=True, help="Do not say which files were written.")
def command(files: tuple[str, ...], out: str | None, quiet: bool) -> None:
    """Redraw the plot of each results FILE, from the file alone."""
    from pathlib import Path

    from suspension_cli.plots.style import image
    from suspension_cli.results import open_results, write_bytes

    for file in files:
        with _spoilt(file), open_results(file) as results:
            picture = image(_figure(results))
        path = (options.folder(out) if out else Path(file).parent) / f"{Path(file).stem}.png"
        write_bytes(path, picture, key="--out" if out else "")
        if not quiet:
            options.tell(f"wrote {path}")


@contextlib.contextmanager
def _spoilt(file: str) -> Iterator[None]:
    """Tell whatever goes wrong as a fault of the file, which all that is drawn comes from."""
    import warnings

    from suspension_cli.errors import Fault, InputError, faults_of
    from suspension_cli.results import brief

    again = "run the analysis again"
    with faults_of(file), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of numbers that are not finite
        try:
            yield
        except (InputError, MemoryError):
            raise
        except KeyError as error:
            raise InputError([Fault("", f"is incomplete: {error.args[0]}", again)]) from None
        except Exception as error:
            raise InputError([Fault("", f"cannot be drawn, as what it holds does not go together ({brief(error)})", again)]) from None


def _figure(results: Any) -> Any:
    """The figure of whichever analysis a file holds."""
    from suspension_cli.design.reader import parse
    from suspension_cli.errors import Fault, InputError

    design = parse(str(results.attrs["design"]))
    known = [name for name in _DRAWN if name in results]
    if not known:
        raise InputError([Fault("", "holds nothing that has a plot", f"name a file of pendsus {', '.join(_DRAWN)}")])
    return _DRAWN[known[0]](results, design)


def _modes(results: Any, design: Any) -> Any:
    from suspension_cli.mechanics.nominal import expand
    from suspension_cli.plots import modes as picture
    from suspension_cli.results import modes as stored

    return picture.draw(stored.load(results), design, expand(design))


def _response(results: Any, design: Any) -> Any:
    from suspension_cli.plots import response as picture
    from suspension_cli.results import response as stored

    return picture.draw(stored.load(results["response"]), design.design.title or design.design.name)


def _thermal(results: Any, design: Any) -> Any:
    from suspension_cli.plots import thermal as picture
    from suspension_cli.results import thermal as stored

    return picture.draw(stored.load(results["thermal"]), design.design.title or design.design.name)


def _damp(results: Any, design: Any) -> Any:
    from suspension_cli.plots import damp as picture
    from suspension_cli.results import damp as stored

    return picture.draw(stored.load(results["damp"]), design.design.title or design.design.name)


def _matrix(results: Any, design: Any) -> Any:
    from suspension_cli.plots import matrix as picture
    from suspension_cli.results import response as stored

    return picture.draw(stored.load(results["matrix"]), design.design.title or design.design.name)


def _xcouple(results: Any, design: Any) -> Any:
    from suspension_cli.plots import coupling as picture
    from suspension_cli.results import coupling as stored

    return picture.draw(stored.read(results["xcouple"]), design.design.title or design.design.name)


def _sweep(results: Any, design: Any) -> Any:
    from suspension_cli.plots import sweep as picture
    from suspension_cli.results import sweep as stored

    return picture.draw(stored.read(results["sweep"]), design.design.title or design.design.name)


def _sensitivity(results: Any, design: Any) -> Any:
    from suspension_cli.plots import sensitivity as picture
    from suspension_cli.results import sensitivity as stored

    return picture.draw(stored.load(results["sensitivity"]), design.design.title or design.design.name, str(results.attrs["fidelity"]))


def _fit(results: Any, _: Any) -> Any:
    from suspension_cli.plots import fit as picture
    from suspension_cli.results import fit as stored

    return picture.draw(stored.load(results["fit"]), str(results["fit"].attrs["title"]))


def _optimise(results: Any, design: Any) -> Any:
    from suspension_cli.plots import optimise as picture
    from suspension_cli.results import optimise as stored

    return picture.draw(stored.load(results["optimise"]), design.design.title or design.design.name)


def _tolerance(results: Any, design: Any) -> Any:
    from suspension_cli.plots import tolerance as picture
    from suspension_cli.results import tolerance as stored

    group = results["tolerance"]
    summary = stored.summarised(group, stored.job(group, str(results.attrs["design"])), float(group.attrs["limit"]))
    return picture.draw(summary, design.design.title or design.design.name, f"{group.attrs['over']} / {group.attrs['under']}")


def _tradeoff(results: Any, design: Any) -> Any:
    from suspension_cli.plots import tradeoff as picture
    from suspension_cli.results import tradeoff as stored

    return picture.draw(stored.load(results["tradeoff"]), design.design.title or design.design.name)


_DRAWN = {
    "modes": _modes,
    "response": _response,
    "thermal": _thermal,
    "damp": _damp,
    "matrix": _matrix,
    "xcouple": _xcouple,
    "tolerance": _tolerance,
    "sweep": _sweep,
    "sensitivity": _sensitivity,
    "fit": _fit,
    "optimise": _optimise,
    "tradeoff": _tradeoff,
}
"""Group of a results file to its figure."""
