"""`pendsus plot`: redraw from a results file alone."""

from __future__ import annotations

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

    from suspension_cli.plots.style import save
    from suspension_cli.results import writing_to

    for file in files:
        figure = _figure(file)
        path = (options.folder(out) if out else Path(file).parent) / f"{Path(file).stem}.png"
        with writing_to(path, "--out" if out else ""):
            save(figure, path)
        if not quiet:
            options.tell(f"wrote {path}")


def _figure(file: str) -> Any:
    """The figure of whichever analysis a file holds."""
    from suspension_cli.design.reader import parse
    from suspension_cli.errors import Fault, InputError
    from suspension_cli.results import open_results

    try:
        with open_results(file) as results:
            design = parse(str(results.attrs["design"]))
            known = [name for name in _DRAWN if name in results]
            if not known:
                raise InputError([Fault("", "holds nothing that has a plot", f"name a file of pendsus {', '.join(_DRAWN)}")])
            return _DRAWN[known[0]](results, design)
    except KeyError as error:
        raise InputError([Fault("", f"is incomplete: {error.args[0]}", "run the analysis again")], file) from None
    except InputError as error:
        raise error if error.file else error.in_file(file) from None


def _modes(results: Any, design: Any) -> Any:
    from suspension_cli.design.expand import expand
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
