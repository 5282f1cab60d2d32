"""Analyses of many builds: their model, and the results file that is filled chunk by chunk."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING

from suspension_cli.analyses import options
from suspension_cli.analyses.analysis import Analysis, Result, Run
from suspension_cli.errors import Interrupted, escape_unprintable
from suspension_cli.files.hdf5 import Provenance, open_results, replacing
from suspension_cli.files.whole_files import target, writing_to
from suspension_cli.studies.run import describe_exposure, part_of
from suspension_cli.studies.run import run as compute

if TYPE_CHECKING:
    from suspension_cli.models.registry import Choice
    from suspension_cli.studies.run import Job, Write

UNRECORDED = {
    name: 0 if one.is_flag else 1
    for one in (*options.SWEEP, *options.WRITING)
    if one.group in (options.BATCH, options.FILES) and one is not options.OVERRIDES
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


def fill(run: Run, analysis: Analysis, job: Job, choice: Choice, write: Write) -> Result:
    """Compute all points of a job, write the results file, and read the result from there.

    `write` writes the group of the analysis. Raises `Interrupted` after Ctrl-C or another signal;
    the message says how to continue.
    """
    setting = run.setting
    path = target(run.folder / f"{run.source.stem()}-{analysis.stem}.h5")
    origin = Provenance(
        run.source.text,
        recorded(run.command),
        choice.level,
        choice.reason,
        choice.error,
    )
    if setting["scheduler"] and (exposure := describe_exposure(setting["scheduler"])):
        run.log.warn(exposure)
    with writing_to(run.folder):
        run.folder.mkdir(parents=True, exist_ok=True)
    try:
        with replacing(path, run.source.text, run.log.say), run.log.progress() as progress:
            how = {name: setting[name] for name in ("workers", "scheduler", "chunk", "resume")}
            compute(job, path, analysis.name, origin, write, progress=progress, **how)
    except KeyboardInterrupt as cause:
        part = part_of(path)
        kept = f"; finished points are in {part}; --resume continues" if part.exists() else ""
        raise Interrupted.by(cause, escape_unprintable(kept)) from None
    with open_results(path) as file:
        data = analysis.load(file)
    return Result(analysis, run.source, choice, data, file=path, command=run.command)
