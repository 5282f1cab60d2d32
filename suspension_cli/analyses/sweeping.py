"""Analyses of many builds: their model, and the results file that is filled chunk by chunk."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

from suspension_cli.analyses import options
from suspension_cli.analyses.analysis import Analysis, Run
from suspension_cli.analyses.logs import RunLog
from suspension_cli.analyses.replaced_results import replacing
from suspension_cli.errors import Interrupted, escape_unprintable
from suspension_cli.files.hdf5 import Provenance, open_results, write_warnings
from suspension_cli.files.whole_files import target, writing_to
from suspension_cli.models.registry import MODELS
from suspension_cli.physics import model_choice
from suspension_cli.studies.interpolated import InterpolatedMap, interpolated
from suspension_cli.studies.run import Columns, Verdict, describe_exposure, part_of
from suspension_cli.studies.run import run as compute

if TYPE_CHECKING:
    import h5py

    from suspension_cli.analyses.analysis import Settings
    from suspension_cli.analyses.record import Origin
    from suspension_cli.design.reader import Source
    from suspension_cli.models.base import Model
    from suspension_cli.models.choice import Comparison
    from suspension_cli.models.registry import Choice
    from suspension_cli.scene.arrays import Array
    from suspension_cli.studies.run import Job

    Points = Array
    """Points of a study, one per row: numbers, or deviations of random builds."""

J = TypeVar("J", bound="Job")
"""Kind of job."""

UNRECORDED = {
    name: 0 if one.is_flag else 1
    for one in (*options.SWEEP, *options.WRITING)
    if one.group in (options.BATCH, options.FILES) and one not in (options.OVERRIDES, options.TIES)
    for name in (*one.opts, *one.secondary_opts)
}
"""Options that do not change the result, and the number of words that follow each."""


def recorded(command: str) -> str:
    """Command line without the options in `UNRECORDED`.

    The same sweep then writes the same file, however it was run.

    >>> recorded("pendsus xcouple a.toml --workers 3 --sweep k=1:2:3 -q")
    'pendsus xcouple a.toml --sweep k=1:2:3'
    """
    kept: list[str] = []
    words = iter(shlex.split(command))
    for word in words:
        name, equals, _ = word.partition("=")
        if name not in UNRECORDED:
            kept.append(word)
        elif not equals:
            for _skipped in range(UNRECORDED[name]):
                next(words, None)
    return shlex.join(kept)


@dataclass(frozen=True)
class Study(Generic[J]):
    """Many builds, whose model is chosen at some of them, and again when they are computed.

    Results that turn out largest or change fastest decide then, such as at a resonance that no
    build of the first comparison meets.

    Attributes
    ----------
    at
        The job in a model, by its name.
    models
        The models that it can use, from the cheapest to the most complete.
    compare
        Comparison of models at some points, an array with a row per point.
    first
        Points of the comparison before the job is computed.
    extremes
        Points at which results of a finished job are extreme.
    write
        Writes the group of the analysis, and returns the record that it wrote; `Origin` is what its
        field `run` says.
    warnings
        What a finished job warns of.
    more
        The job with more points than a finished one, whose results do not suffice; None if they do.
    """

    at: Callable[[str], J]
    models: Sequence[Model]
    compare: Callable[[Points], Comparison]
    first: Points
    extremes: Callable[[J, Columns], Points]
    write: Callable[[h5py.Group, Columns, J, Origin], Any]
    warnings: Callable[[Any, J], Iterable[str]]
    more: Callable[[J, Columns], J | None] = lambda _job, _columns: None

    def choose(self, source: Source, setting: Settings) -> Choice:
        """Choose the model before the job is computed."""
        return self._choose(source, setting, self.models, self.first)

    def choose_again(
        self, source: Source, setting: Settings, last: Choice, points: Points
    ) -> Choice:
        """Choose the model by more points: the last one, or a more complete one."""
        found = self._choose(source, setting, self.models, points)
        if MODELS.index(found.model) >= MODELS.index(last.model):
            return found
        remaining = self.models[self.models.index(last.model) :]
        return self._choose(source, setting, remaining, points)

    def _choose(
        self, source: Source, setting: Settings, models: Sequence[Model], points: Points
    ) -> Choice:
        change, wanted = self.compare(points), setting["fidelity"]
        return model_choice.for_builds(source, wanted, models, change, setting["tolerance"])


class _Review(Generic[J]):
    """Review of the results of a study: the model that they need.

    Attributes
    ----------
    job
        The job in that model.
    computed
        The same job, or its map by interpolation.
    """

    def __init__(self, run: Run, analysis: Analysis, study: Study[J], choice: Choice) -> None:
        self.run = run
        self.analysis = analysis
        self.study = study
        self.choice = choice
        self.job = study.at(choice.level)
        self.computed = self._as_map()
        self.points = study.first
        self.warned: list[str] = []

    def _as_map(self) -> Job | InterpolatedMap:
        """Interpolate the job, if that is possible and `--every-point` is not given."""
        job: Any = self.job
        if self.run.setting.get("every_point", True) or not job.is_analytic:
            return job
        found = interpolated(job)
        if found is None:
            return job
        self.run.log.say(f"{self.run.name}: {found.line}")
        if (self.run.setting["workers"] or 1) > 1:
            self.run.log.say("--workers has no effect on an interpolated map: it takes one process")
        return found

    @property
    def origin(self) -> Provenance:
        """What the results file says about its origin."""
        choice = self.choice
        command = recorded(self.run.command)
        return Provenance(self.run.source.text, command, choice.level, choice.reason, choice.error)

    def write(self, group: h5py.Group, columns: Columns) -> None:
        """Write the group of the analysis, and what the run and its results warn of."""
        origin = self.run.origin(self.analysis, self.choice)
        record = self.study.write(group, columns, self.job, origin)
        if isinstance(self.computed, InterpolatedMap):
            group.attrs["interpolation"] = self.computed.line
        self.warned = [*self.study.warnings(record, self.job)]
        write_warnings(group.file, (*origin.warnings, *self.warned))

    def __call__(self, columns: Columns) -> Verdict:
        """Choose the model again, with the points at which results are extreme."""
        extreme = self.study.extremes(self.job, columns)
        self.points = np.unique(np.concatenate([self.points, extreme]), axis=0)
        run = self.run
        last = self.choice
        self.choice = self.study.choose_again(run.source, run.setting, last, self.points)
        if self.choice.level == last.level:
            more = self.study.more(self.job, columns)
            if more is not None:
                self.job = self.computed = more
            return Verdict(self.origin, self.write, more, keeps_points=True)
        why = self.choice.reason.partition(";")[0]
        level = self.choice.level
        run.log.say(f"{run.name}: all builds are computed again in the {level} model: {why}")
        self.job = self.study.at(level)
        self.computed = self._as_map()
        return Verdict(self.origin, self.write, self.computed)


def fill(run: Run, analysis: Analysis, study: Study[Any], choice: Choice) -> Any:
    """Compute all points of a study, write the results file, and read the result from there.

    If the results show that the model of a `choice` is not accurate enough, they are computed in a
    more complete one. Raises `Interrupted` after Ctrl-C or another signal; the message
    says how to continue.
    """
    setting = run.setting
    path = target(run.folder / f"{run.source.stem()}-{analysis.stem}.h5")
    review = _Review(run, analysis, study, choice)
    _warn_of_exposure(run)
    with writing_to(run.folder):
        run.folder.mkdir(parents=True, exist_ok=True)
    how = {name: setting[name] for name in ("workers", "scheduler", "chunk", "resume")}
    if isinstance(review.computed, InterpolatedMap):
        how["chunk"] = max(how["chunk"], review.computed.chunk)
    try:
        with replacing(path, run.source, run.log.say), run.log.progress() as progress:
            begin = review.computed, path, analysis.name, review.origin, review.write
            compute(*begin, review=review, progress=progress, **how)
    except KeyboardInterrupt as cause:
        part = part_of(path)
        kept = "; nothing was kept, as no chunk of points was finished"
        if part.exists():
            kept = f"; finished points are in {part}; --resume continues"
        raise Interrupted.by(cause, escape_unprintable(kept)) from None
    for line in review.warned:
        run.log.warn(line)
    origin = replace(run.origin(analysis, review.choice), file=path)
    with open_results(path) as file:
        return analysis.read_result(file, origin, {})


def _warn_of_exposure(run: Run) -> None:
    """Warn of a scheduler that others may reach.

    That says nothing of the results, whose file does not depend on how they were computed.
    """
    scheduler = run.setting["scheduler"]
    exposure = describe_exposure(scheduler) if scheduler else ""
    if exposure:
        assert isinstance(run.log, RunLog)
        run.log.outer.warn(exposure)
