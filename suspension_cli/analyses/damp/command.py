"""`pendsus damp`: local control."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import click

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import Analysis, Document, Run, Settings
from suspension_cli.analyses.options import option
from suspension_cli.errors import InputError, format_value

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from suspension_cli.analyses.damp.solve import Damped, LocalControl
    from suspension_cli.design.loop_sensors import Sensor
    from suspension_cli.design.schema import Design
    from suspension_cli.linear.statespace import Poles


LOOPS = option(
    "--loop",
    "loops",
    multiple=True,
    metavar="NAME",
    help="Draw the gain of this loop (repeatable).  [default: the three most critical]",
)


DESIGNING = (
    option(
        "--design",
        "method",
        type=click.Choice(["lqg", "h2", "hinf", "blend"]),
        help="Find the filters of loops first, which damp all modes within --settling, with the"
        " largest margins to the design's [[requirement]] tables, or without any the least noise of"
        " the sensor: lqg least squares with a prescribed decay, h2 without it, hinf H-infinity;"
        " or blend the filters of blends of two sensors, from their noise. Writes the design with"
        " them to DIR/NAME-lqg.toml, ...",
    ),
    option(
        "--redesign",
        "redesigned",
        multiple=True,
        metavar="NAME",
        help="Loop, or blend, whose filter is found (repeatable).  [default: all, in their order]",
    ),
    option(
        "--order",
        type=click.IntRange(1, 8),
        default=3,
        help="Poles of the fitted ratio of two noises, for --design blend, whose filters have up to"
        " twice as many.",
    ),
    option(
        "--settling",
        type=click.FloatRange(1e-3, 1e6),
        help="Longest time, s, in which the amplitude of a mode falls to 1/e, for --design."
        "  [default: as required, else 10]",
    ),
    option(
        "--sensitivity",
        type=click.FloatRange(1.0, 100.0, min_open=True),
        help="Largest magnitude of the sensitivity, for --design.  [default: as required, else 2]",
    ),
    option(
        "--quiet-at",
        type=click.FloatRange(1e-3, 1e5),
        default=10.0,
        help="Frequency in Hz at which the sensor's noise is to be least, at --output or in the"
        " mirror's motion along the force, for --design.",
    ),
    option(
        "--highest",
        type=click.FloatRange(1e-3, 1e5),
        default=10.0,
        help="Frequency in Hz up to which modes are damped, for --design.",
    ),
    option(
        "--reached",
        type=click.FloatRange(1e-9, 1.0, max_open=True),
        default=1e-4,
        help="Response of a mode to the loop's force, over that of the strongest mode, from which"
        " the loop has to damp it, for --design: 0.01 leaves modes of coupled motions to their own"
        " loops.",
    ),
)


class DampAnalysis(Analysis):
    """Close the loops of the design's [control] table.

    Prints closed-loop poles with their Q, the margins of gain, phase and delay of each loop, and
    those of all loops at once. Draws poles, loop gains (Bode and Nichols charts), and the impulse
    response and sensor noise of one motion. An unstable closed loop is reported with its growth
    rate; it has no margins. Writes DIR/NAME-damp.h5 and .png.

    Example: pendsus damp configs/triple-damped.toml

    Returns
    -------
    Damped
        With `closed` poles, `margin` of each loop, `sensitivity` of all at once, `noise`
        (f, sensors), ...

    Raises
    ------
    InputError
        If the design has no loops.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> design = sus.example("triple-damped")
    >>> sus.damp(design, frequency=[1.0], duration=1.0, fidelity="string").stable
    True
    """

    name = "damp"
    result_type = "analyses.damp.solve.Damped"
    arguments = (options.DESIGN,)
    parameters = (
        option(
            "--output",
            metavar="SIGNAL",
            help="Motion whose impulse response and sensor noise are computed."
            "  [default: x of the mirror]",
        ),
        option(
            "--impulse",
            metavar="SIGNAL",
            help="Force or torque that gives an impulse of 1 N s or 1 N m s."
            "  [default: that along --output]",
        ),
        option(
            "--duration",
            type=click.FloatRange(1e-3, 1e6),
            default=60.0,
            help="Length of the impulse response, s.",
        ),
        options.frequencies("0.1:100:2000", "Frequencies of loop gains and noise, Hz."),
        LOOPS,
        option(
            "--foton",
            is_flag=True,
            help="Also write the filters as Foton strings, to DIR/NAME-foton.txt.",
            group=options.FILES,
        ),
        *DESIGNING,
        options.ALLOW_UNSTABLE,
        options.ACCURACY,
        *options.WRITING,
    )
    drawn_with = (LOOPS,)

    def solve(self, run: Run) -> Damped:
        """Close all loops."""
        from suspension_cli.analyses.damp import solve

        if run.design.control is not None:
            known = [loop.name for loop in run.design.control.loop]
            _chosen(run.setting["loops"], known)
            if run.setting["method"] != "blend":
                _chosen(run.setting["redesigned"], known, "--redesign")
        return solve.close_loops(self, run)

    def others(self, result: Damped, path: Path) -> list[Path]:
        """Write the filters as Foton strings, and the design with filters that were found."""
        from suspension_cli.files import whole_files

        design = result.run.design
        written = []
        if result.designed or result.blends:
            method = result.run.options["method"]
            written.append(path.with_name(f"{design.stem()}-{method}.toml"))
            whole_files.write_bytes(written[-1], design.text.encode())
        if result.run.options.get("foton"):
            written.append(path.with_name(f"{design.stem()}-foton.txt"))
            whole_files.write_bytes(written[-1], write_foton(design.design).encode())
        return written

    def parse_names(
        self, design: Design, stages: tuple[str, ...], known: tuple[str, ...]
    ) -> Iterator[Callable[[], object]]:
        """Parse the sensors and actuators of the loops."""
        from suspension_cli.physics.local_control import parse_actuator, parse_sensor

        control = design.control
        if control is None:
            return
        osems = control.osem
        for sensor in control.sensor:
            yield lambda one=sensor: parse_sensor(one, osems, stages, known)
        for loop in control.loop:
            if control.named_sensor(loop) is None:
                yield lambda one=loop: parse_sensor(one, osems, stages, known)
            yield lambda one=loop: parse_actuator(one, osems, known)

    def document(self, result: Damped) -> Document:
        """Add the noise of all sensors; a pole that grows has no Q, an unstable loop no margins."""
        document = super().document(result)
        for pole in document["poles"]:
            pole["q"] = None if "growth_rate_per_s" in pole else pole["q"]
        if result.margin is None:
            document["margins"] = None
        return document | {"sensor_noise_asd": (result.noise**2).sum(1) ** 0.5}

    def text(self, result: Damped) -> str:
        """Return tables of poles and margins."""
        lines = [] if result.stable else [f"UNSTABLE: {result.growth}", ""]
        rows = []
        for frequency, q, rate, _, state in _rows(result.closed):
            size = "undamped" if q == math.inf else q
            if rate:
                size = "grows"
            rows.append((frequency, size, state + (f", {rate:.4g} 1/s" if rate else "")))
        columns = {"closed-loop pole\nHz": "#.5g", "Q": ".4g", "largest in": ""}
        lines += [result.run.choice.line, "", *_designed(result), *_blends(result)]
        lines += [tables.render(columns, rows), ""]
        lines += _matrices(result)
        if result.margin is None:
            return "\n".join([*lines, "  An unstable closed loop has no margins."])
        rows = [
            (
                *(loop, m.phase if m.phase < math.inf else "gain below 1", m.phase_frequency),
                " and ".join(map(_factor, m.gains)) or "without limit",
                " and ".join(f"{place:.3g}" for place in m.gain_frequencies),
                *(1e3 * m.delay if m.delay < math.inf else "none", m.distance),
            )
            for loop, m in zip(result.loop, result.margin, strict=True)
        ]
        columns = {
            "loop": "",
            "phase margin\ndegrees": ".1f",
            "at\nHz": ".3g",
            "gain margin": "",
            " at\nHz": "",
            "delay margin\nms": ".3g",
            "smallest |1+L|": ".3g",
        }
        lines.append(tables.render(columns, rows))
        peak = result.sensitivity
        if peak is not None and len(result.loop) > 1:
            gains = f"above {_factor(peak.gain_down)}"
            if peak.gain_up < math.inf:
                up = f"x {peak.gain_up:.3g} (+{20 * math.log10(peak.gain_up):.1f} dB)"
                gains = f"from {_factor(peak.gain_down)} to {up}"
            lines += [
                "",
                "  All loops at once: largest singular value of the sensitivity"
                f" {peak.size:.4g} at {peak.frequency:.4g} Hz;",
                f"  stable if each gain changes by any factor {gains},"
                f" or each phase by less than {peak.phase:.0f} degrees.",
            ]
        return "\n".join(lines)

    def figures(self, result: Damped, setting: Settings) -> dict[str, Figure]:
        """Draw poles, impulse response, sensor noise, loop gains and their Nichols chart."""
        from suspension_cli.analyses.damp import picture

        return {"": picture.draw(result, _chosen(setting["loops"], result.loop))}


def _rows(poles: Poles) -> Iterator[tuple[float, float, float, complex, str]]:
    """Iterate over frequency (Hz), Q, growth rate (1/s), value (rad/s) and state of poles."""
    return zip(poles.frequency, poles.q, poles.growth_rate, poles.value, poles.state, strict=True)


def _matrices(answer: LocalControl) -> Iterator[str]:
    """Write tables of the matrices of OSEMs."""
    for one in answer.osems or ():
        for title, matrix, rows, columns in (
            ("coordinates (m, rad) from readings (m)", one.to_euler, one.coordinate, one.osem),
            ("forces of coils (N) from loops (N, N m)", one.to_coil, one.osem, one.coordinate),
        ):
            table = [(name, *row) for name, row in zip(rows, matrix.tolist(), strict=True)]
            yield f"  {one.stage}: {title}"
            yield tables.render({"": ""} | dict.fromkeys(columns, ".4g"), table) + "\n"


def _designed(result: Damped) -> Iterator[str]:
    """Tabulate filters that were found, and what they do."""
    if not result.designed:
        return
    at = result.designed[0].quiet_at
    columns = {
        "loop found": "",
        "settles in\ns": ".3g",
        "largest\nsensitivity": ".3g",
        "output": "",
        f"over sensor noise\nat {at:g} Hz": ".3g",
        "roll-off\nHz": ".3g",
        "poles": "",
        "hardly reached\nHz": "",
    }
    rows = [
        (
            one.redesigned,
            one.settling,
            one.sensitivity,
            one.output,
            one.noise,
            one.roll_off,
            one.poles,
            one.left_out,
        )
        for one in result.designed
    ]
    yield tables.render(columns, rows)
    yield ""
    if not result.required:
        return
    columns = {"": "", "value": ".4g", "unit": "", "margin\n%": "+.3g", "requirement": ""}
    rows = [
        (
            "met" if one.met else "NOT met",
            "none" if math.isnan(one.value) else one.value,
            one.unit,
            100 * one.margin,
            one.requirement,
        )
        for one in result.required
    ]
    yield tables.render(columns, rows)
    yield ""


def _blends(result: Damped) -> Iterator[str]:
    """Tabulate complementary filters that were found."""
    if not result.blends:
        return
    columns = {
        "blend found": "",
        "filter K": "",
        "1 - K": "",
        "alike at\nHz": ".3g",
        "bound": ".4g",
        "poles": "",
        "error of fit\n%": ".2g",
        "largest ratio": ".4g",
    }
    rows = [
        (
            one.blended,
            one.first,
            one.second,
            one.crossing,
            one.bound,
            one.poles,
            100 * one.misfit,
            one.largest,
        )
        for one in result.blends
    ]
    yield tables.render(columns, rows)
    yield ""


def _chosen(names: Sequence[str], known: Sequence[str], key: str = "--loop") -> list[int]:
    """Numbers of the loops that an option names."""
    from suspension_cli.design.faults import suggest

    for name in names:
        if name not in known:
            problem = "names no loop"
            remedy = suggest(name, list(known))
            raise InputError.of(key, problem, remedy, format_value(name))
    return [n for n, name in enumerate(known) if name in names]


def _factor(gain: float) -> str:
    return f"x {gain:.3g} ({20 * math.log10(gain):.1f} dB)"


def _foton_of_sensor(sensor: Sensor) -> list[str]:
    """Write the filters of the inputs of a computed sensor, with comments."""
    from suspension_cli.design.foton import format_filter

    if not sensor.inputs:
        return []
    lines = ["", f"# sensor {sensor.name}: the sum of"]
    for one in sensor.inputs:
        source = one.sensor or f"the force demanded by loop {one.drive}"
        if one.is_rest:
            lines.append(f"# {source}, through 1 less the filters of the others")
        else:
            rate = f", digital, at {one.made.rate:g} Hz" if one.made.rate else ""
            lines += [f"# {source}{rate}, through", format_filter(one.made)]
    return lines


def write_foton(design: Design) -> str:
    """Write the filters of all loops, one design string per loop, with comments."""
    from suspension_cli.design.foton import format_filter

    lines = [
        f"# filters of {design.design.name}, plane n (roots in Hz)",
        "# actuator (N or N m) = - filter * sensor (m or rad)",
    ]
    control = design.control
    if control is None:
        return "\n".join(lines) + "\n"
    for sensor in control.sensor:
        lines += _foton_of_sensor(sensor)
    for loop in control.loop:
        ends = f"{loop.sensor} -> {loop.actuator}, reference {loop.reference}"
        lines += ["", f"# {loop.name}: {ends}"]
        if loop.damper is not None:
            lines += [
                "# a velocity damper: Foton adds a pole at 1/pi of the sample rate, and turns the",
                "# sign, which is why the gain is negative; with a pole of its own it is positive",
            ]
        if loop.sensor_response is not None:
            given = loop.sensor_response
            text = given if isinstance(given, str) else given.source or given.design
            lines.append(f"# not included: response of the sensor {text}")
        if loop.controller.rate:
            lines.append(f"# digital, at {loop.controller.rate:g} Hz")
        if loop.delay:
            lines.append(f"# not included: delay of {loop.delay:g} s")
        lines.append(format_filter(loop.controller))
    return "\n".join(lines) + "\n"


ANALYSIS = DampAnalysis()
