"""`pendsus fit`: fit of designs to measured modes, quantities and transfer functions."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from suspension_cli.analyses import options
from suspension_cli.analyses.analysis import Analysis, Document, Run, Settings
from suspension_cli.analyses.logs import Log
from suspension_cli.analyses.options import argument, option
from suspension_cli.errors import Fault, InputError, attribute_faults_to, format_value, join_errors

if TYPE_CHECKING:
    import h5py
    from matplotlib.figure import Figure

    from suspension_cli.analyses.fit.result import Fit, Fitted
    from suspension_cli.analyses.record import Origin
    from suspension_cli.design.measured import Measured
    from suspension_cli.design.reader import Source
    from suspension_cli.measurements.transfer_function import MeasuredResponse
    from suspension_cli.models.base import Model
    from suspension_cli.models.choice import Comparison
    from suspension_cli.models.registry import Choice


class FitAnalysis(Analysis):
    """Fit numbers of designs to measured modes, quantities and transfer functions.

    MEASURED is a TOML file. It lists the free numbers of DESIGN, and modes and quantities with
    uncertainties or files of transfer functions. To fit several designs together, leave DESIGN out:
    MEASURED names the designs, and the free numbers that they share. Writes DIR/NAME-fit.h5 and
    .png, and each fitted design as DIR/NAME-fitted.toml. NAME is that of the design; for several
    designs it is the stem of MEASURED, followed by the experiment's name for fitted designs. With
    --matrices the fitted design has the measured sensing and driving of its OSEMs.

    Example: pendsus fit my.toml measured.toml
    Example: pendsus fit my.toml measured.toml --matrices

    Returns
    -------
    Fit
        With `name`, `value`, `sigma`, `covariance`, `residual`, ...; for transfer functions
        `responses`, with `--matrices` `matrices`. `design` is the fitted design (of several
        experiments the first of `designs`), `run.design` the one as given.

    Raises
    ------
    InputError
        With the faults of `measured` or of the design.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> design = sus.example("husman2000/table1-case4")
    >>> found = sus.fit("measured/husman2000/table1-case4.toml", design)
    >>> for name, value, sigma in zip(found.parameters, found.value, found.sigma):
    ...     print(f"{name}: {value:.3g} +- {sigma:.2g}")
    materials.steel302.youngs_modulus: 1.66e+11 +- 2.8e+09
    stage.test.body.inertia.2: 0.118 +- 0.0039
    """

    name = "fit"
    result_type = "analyses.fit.result.Fit"
    draws_neglected = True
    arguments = (argument("files", nargs=-1, required=True, metavar="[DESIGN] MEASURED"),)
    inputs = (
        options.Input(
            "measured",
            "PathLike",
            "TOML file of modes, quantities or files of transfer functions, and the free numbers.",
        ),
        options.Input(
            about="The design; None where `measured` names designs itself.", optional=True
        ),
    )
    parameters = (
        option(
            "--starts",
            type=click.IntRange(1, 100_000),
            default=1,
            help=(
                "Number of searches, of which the best is kept. All but the first start from random"
                " numbers."
            ),
        ),
        option(
            "--seed",
            type=click.IntRange(0, 2**64 - 1),
            default=1,
            help="Seed of the random numbers.",
        ),
        option(
            "--relative-uncertainty",
            type=click.FloatRange(0.0, 10.0, min_open=True),
            metavar="FRACTION",
            help="Relative uncertainty of transfer functions whose files give none.",
        ),
        option(
            "--explain/--no-explain",
            default=True,
            help=(
                "With transfer functions, also rank single changes of the design, and measurements"
                " to make next."
            ),
        ),
        option(
            "--matrices",
            is_flag=True,
            help=(
                "Instead of parameters, find the sensing and driving matrices of the OSEMs of a"
                " stage, from transfer functions of all its sensors to all its coils."
            ),
        ),
        options.ACCURACY,
        *options.WRITING,
    )

    def files(self, inputs: Settings) -> Settings:
        """The designs, then the measurements."""
        designs = () if inputs["design"] is None else (inputs["design"],)
        return {"files": (*designs, inputs["measured"])}

    def read(self, ask: Callable[..., Run], files: Settings) -> Run:
        """Read the measurements and all designs; the first design gives default options."""
        from suspension_cli.design import measured, reader
        from suspension_cli.measurements import read as read_measured

        *designs, file = files["files"]
        text = reader.read_text(file)
        given = measured.read(file, text)
        if not given.parameter and not given.transfer_function:
            remedy = "name the numbers to fit in [[parameter]]"
            raise InputError([Fault("parameter", "missing", remedy)], file)
        runs = _designs(ask, designs, file, given)
        inputs = {"file": file, "text": text, "measured": given, "runs": runs}
        if given.transfer_function:
            functions = read_measured.read_all(given, file)
            inputs["functions"] = _weighted(functions, runs[0].setting["relative_uncertainty"])
        return dataclasses.replace(runs[0], inputs=inputs)

    def solve(self, run: Run) -> Fit:
        """Fit all designs together."""
        from suspension_cli.analyses.fit import findings, matrix_fit
        from suspension_cli.analyses.fit import solve as fit
        from suspension_cli.analyses.fit.result import Fit
        from suspension_cli.models import registry
        from suspension_cli.physics import model_choice

        given: Measured = run.inputs["measured"]
        sources = [one.source for one in run.inputs["runs"]]
        file = run.inputs["file"]
        joint = given.experiment is not None
        designs = tuple(one.file for one in sources)
        matrices = run.setting["matrices"]
        if matrices:
            with attribute_faults_to(file):
                matrix_fit.demand_functions_alone(given)
        elif not given.parameter:
            run.log.say(
                "no [[parameter]] is given: lengths, masses and stiffnesses of the design are free,"
                " with priors of usual building errors"
            )
        with attribute_faults_to(file):
            choices = _choose_models(run.setting["fidelity"], sources, given)
        functions = run.inputs.get("functions", ())
        with attribute_faults_to(file), run.log.progress() as bar:
            if matrices:
                found = matrix_fit.fit_design(sources[0], functions, choices[0].level)
            else:
                found = fit.solve(
                    [one.text for one in sources],
                    given,
                    designs,
                    functions,
                    level=choices[0].level,
                    **{name: run.setting[name] for name in ("starts", "seed", "explain")},
                    tell=bar,
                )
        for source, one in zip(sources, choices, strict=True):
            model_choice.warn_of_neglected(source, one, run.log, (registry.BEAM,))
        choice = max(choices, key=lambda one: -1.0 if math.isnan(one.error) else one.error)
        name = Path(file).stem if joint else found.experiment[0]
        data = dataclasses.replace(
            found,
            design_before=tuple(one.text for one in sources),
            measurements=run.inputs["text"],
            title=(given.title if joint else run.design.design.title) or name,
        )
        _warn(data, choice, run.log)
        if run.setting.get("as_json", True):  # printed in the text
            for line in findings.first_lines(data):
                run.log.warn(line)
        return Fit.extending(
            data,
            stem=run.source.stem(name),
            joint=joint,
            design_file=designs,
            measured_file=str(file),
            run=run.origin(self, choice),
        )

    def read_result(self, file: h5py.File, run: Origin, extra: Document) -> Fit:
        """Read a result; files of earlier versions call the files of designs otherwise."""
        files = {"design_file": extra.get("designs", [])}
        return super().read_result(file, run, extra | files)

    def document(self, result: Fit) -> Document:
        """Return fitted parameters and modes; an uncertainty is null if infinite or at a bound."""
        from suspension_cli.analyses.fit import findings

        files = result.design_file or [None] * len(result.experiment)
        return findings.document(result, files)

    def text(self, result: Fit) -> str:
        """Return fitted parameters, modes, and combinations that the data determine."""
        from suspension_cli.analyses.fit import findings

        return f"{result.run.choice.line}\n\n{findings.report(result)}"

    def figures(self, result: Fit, setting: Settings) -> dict[str, Figure]:
        """Draw modes before and after, and fitted numbers."""
        from suspension_cli.analyses.fit import osem_picture, picture

        title = f"{result.title} · {result.run.model} model"
        if result.matrices is not None:
            return {"": osem_picture.draw(result, result.matrices, title)}
        pages = {"": picture.draw(result, title)}
        if result.responses is not None:
            pages["-responses"] = picture.draw_responses(result.responses, title)
        return pages

    def path(self, result: Fit, folder: Path) -> Path:
        """Return the path of the results file, named after the design or the measurements."""
        return folder / f"{result.stem or result.run.name}-{self.stem}.h5"

    def others(self, result: Fit, path: Path) -> list[Path]:
        """Write each fitted design: NAME-fitted.toml, of several NAME-EXPERIMENT-fitted.toml."""
        from suspension_cli.analyses.fit import findings
        from suspension_cli.files.whole_files import write_bytes

        paths = []
        command = result.run.command
        measured = Path(result.measured_file).name
        pairs = zip(result.experiment, result.design_file, strict=True)
        for n, (name, file) in enumerate(pairs):
            stem = f"{result.stem}-{name}" if result.joint else result.stem
            paths.append(path.with_name(f"{stem}-fitted.toml"))
            made = findings.fitted_design(result, n, Path(file).name, measured, command)
            write_bytes(paths[-1], made.encode())
        return paths


def _weighted(functions: list[MeasuredResponse], relative: float | None) -> list[MeasuredResponse]:
    """Give a relative uncertainty to values that have none."""
    import numpy as np

    if relative is None:
        return functions
    result = []
    for item in functions:
        size = np.abs(item.value)
        sigma = np.asarray(item.uncertainty)
        assumed = relative * np.maximum(size, 1e-3 * np.median(size))
        known = np.isfinite(sigma) & (sigma > 0)
        result.append(dataclasses.replace(item, uncertainty=np.where(known, sigma, assumed)))
    return result


def _choose_models(wanted: str, sources: Sequence[Source], given: Measured) -> list[Choice]:
    """Choose the most complete model without wire mass that is valid for every design of a fit.

    Raises `InputError` if a model is wanted that cannot model imperfect builds, or has wire mass.
    """
    from suspension_cli.models import choice, registry
    from suspension_cli.physics import model_choice

    models = [model for model in registry.SCENE_MODELS if not model.has_wire_mass]
    model_choice.demand_one_of(wanted, models, "cannot compute derivatives")
    each = [registry.most_complete(source.design, massless=True) for source in sources]
    common = min(each, key=registry.MODELS.index)
    found = []
    for n, source in enumerate(sources):
        compare = _compare_models(source, given, n)
        with attribute_faults_to(source.file):
            found.append(choice.choose(source.design, wanted, [common], compare))
    return found


def _compare_models(source: Source, given: Measured, number: int) -> Comparison:
    """Return the comparison of all modes and of the measured quantities of an experiment.

    Modes count unless quantities alone were measured.
    """
    from suspension_cli.analyses.fit.measured_values import look_up
    from suspension_cli.models.choice import Frequencies, Systems
    from suspension_cli.quantities.differences import compare_designs

    quantities = look_up(given.quantities[number], source.text, source.file, given.where(number))
    compared: list[Comparison] = []
    if given.modes[number] or given.transfer_function or not quantities:
        compared.append(Systems(source.design).compare(lambda _: Frequencies()))
    if quantities:
        compared.append(compare_designs(quantities, [source.design]))

    def change(simple: Model, refined: Model) -> tuple[float, str]:
        changes = [compare(simple, refined) for compare in compared]
        return max(changes, key=lambda one: -1.0 if math.isnan(one[0]) else one[0])

    return change


def _designs(
    ask: Callable[..., Run], designs: Sequence[str], file: str, given: Measured
) -> list[Run]:
    """Read the measured designs; report the faults of all at once."""
    if given.experiment is None:
        if len(designs) != 1:
            problem = f"needs exactly one design, but {len(designs)} are given"
            remedy = "write pendsus fit DESIGN MEASURED, or name designs in [[experiment]]"
            raise InputError([Fault("mode", problem, remedy)], file)
        return [ask(designs[0])]
    if designs:
        problem = "names its designs itself"
        remedy = "write pendsus fit MEASURED"
        raise InputError([Fault("experiment", problem, remedy, format_value(designs[0]))], file)
    runs: list[Run] = []
    bad: dict[str, InputError] = {}
    for n, item in enumerate(given.experiment, 1):
        try:
            runs.append(ask(str(Path(file).parent / item.design), tuple(item.set)))
        except InputError as error:
            overrides = {format_value(text) for text in item.set}
            moved = [
                dataclasses.replace(fault, key=f"experiment.{n}.set")
                for fault in error.faults
                if fault.value in overrides
            ]
            reported = InputError(moved, file) if moved else error
            bad[str(reported)] = reported
    if bad:
        raise join_errors(list(bad.values()))
    return runs


def _warn(found: Fitted, choice: Choice, log: Log) -> None:
    """Warn of numbers at bounds, negative stiffnesses, and implausible or unstable designs."""
    from suspension_cli.analyses.fit import findings
    from suspension_cli.design import reader
    from suspension_cli.physics import near_limits
    from suspension_cli.physics.growth import find_growth

    for label, bound in zip(found.parameters, found.at_bound, strict=True):
        if bound:
            log.warn(f"{label} ends at its bound, so it has no uncertainty; widen the bound")
    for line in findings.negative_stiffnesses(found):
        log.warn(line)
    for name, fitted in zip(found.experiment, found.toml, strict=True):
        design = reader.parse(fitted)
        near_limits.warn_implausible(design, log)
        grows = find_growth(design, choice.model, choice.model.system(design))
        if grows is not None:
            log.warn(
                f"the fitted design {name} is unstable in the {choice.level} model: {grows.worst};"
                " give bounds or priors to the numbers that make it so"
            )


ANALYSIS = FitAnalysis()
