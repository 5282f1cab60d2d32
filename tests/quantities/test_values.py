"""Every kind of quantity against the command that prints the same number, or a closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.named_quantities import names_of
from suspension_cli.linear import response as responses
from suspension_cli.linear import signals
from suspension_cli.models import registry
from suspension_cli.quantities import requirements, solved, vocabulary
from suspension_cli.quantities.needs import Needs
from suspension_cli.quantities.quantity import evaluate as evaluate_all
from tests.support.exchanging import SMALL, D

RELATIVE = 1e-9
LOSSLESS = 1e-6
"""Modes are listed with their losses, which change frequencies by 1 / (8 Q^2) and with phi."""


def evaluate(design: sus.Design, *texts: str, level: str = "beam") -> list[float]:
    """Values of quantities of one design in a model."""
    names = names_of(design)
    wanted = [vocabulary.parse(text, names, "--result") for text in texts]
    [(places, batch)] = solved.of_designs([design.design], level, Needs.of(wanted))
    assert places.tolist() == [0]
    return evaluate_all(wanted, batch)[0].tolist()


@pytest.fixture(scope="module")
def triple() -> sus.Design:
    return sus.example("triple-damped")


@pytest.fixture(scope="module")
def lossy() -> sus.Design:
    return sus.example("geo-silica-triple")


def test_frequencies_are_those_of_modes(lossy):
    modes = sus.modes(lossy, fidelity="beam")
    labels = list(modes.label)
    pitch, fifth, lowest = evaluate(lossy, "test pitch", "5", "lowest vertical")
    assert pitch == pytest.approx(modes.frequency[labels.index("test pitch")], rel=LOSSLESS)
    assert fifth == pytest.approx(modes.frequency[4], rel=LOSSLESS)
    vertical = [f for f, label in zip(modes.frequency, labels, strict=True) if "vertical" in label]
    assert lowest == pytest.approx(min(vertical), rel=LOSSLESS)


def test_decay_is_that_of_modes(lossy):
    modes = sus.modes(lossy, fidelity="beam")
    n = list(modes.label).index("test longitudinal")
    q, decay, settling, dilution = evaluate(
        lossy,
        "Q of test longitudinal",
        "decay of test longitudinal",
        "settling of test longitudinal",
        "dilution of test longitudinal",
    )
    assert q == pytest.approx(modes.q[n], rel=RELATIVE)
    assert decay == pytest.approx(modes.decay_rate[n], rel=RELATIVE)
    assert settling == pytest.approx(1 / modes.decay_rate[n], rel=RELATIVE)
    assert dilution == pytest.approx(modes.dilution[n], rel=RELATIVE)
    assert decay == pytest.approx(math.pi * modes.frequency[n] / q, rel=1e-6)


def test_decay_takes_a_mode_by_any_of_its_names(lossy):
    modes = sus.modes(lossy, fidelity="beam")
    labels = modes.label
    second = [n for n, one in enumerate(labels) if "pitch" in one or "longitudinal" in one][1]
    places = {
        "lowest pitch": [label.endswith("pitch") for label in labels].index(True),
        "upper longitudinal#2": labels.index("upper longitudinal#2"),
        "5": 4,
        "longitudinal-pitch 2": second,
        "yaw 1": [label.endswith("yaw") for label in labels].index(True),
    }
    values = evaluate(lossy, *(f"Q of {name}" for name in places))
    assert values == pytest.approx(modes.q[list(places.values())], rel=RELATIVE)


def test_decay_of_a_mode_by_its_names_with_loops_closed(triple):
    """Q of the pole next to the mode without loops, which 0.5 % of its frequency tells apart."""
    modes = sus.modes(triple, fidelity="beam")
    poles = sus.damp(triple, fidelity="beam").closed.value
    number = modes.label.index("test pitch")
    pole = poles[np.abs(np.abs(poles) - 2 * np.pi * modes.frequency[number]).argmin()]
    names = ["test pitch", "lowest pitch", str(number + 1), "longitudinal-pitch 1"]
    values = evaluate(triple, *(f"Q of {name}" for name in names))
    assert values == pytest.approx([abs(pole) / (-2 * pole.real)] * len(names), rel=1e-6)


def test_a_mode_that_grows_has_no_q_and_meets_no_limit_on_it(triple):
    grows = triple.replace({"control.loop.yaw.gain": -1e3})
    q, decay, settling = evaluate(grows, "Q of modes", "decay of modes", "settling of modes")
    poles = sus.damp(grows, allow_unstable=True, fidelity="beam").closed.value
    assert decay == pytest.approx(-np.real(poles).max(), rel=1e-6)
    assert decay < 0
    assert math.isnan(q)
    assert settling == math.inf
    wanted = vocabulary.parse("Q of modes", names_of(grows), "--result")
    [(_, batch)] = solved.of_designs([grows.design], "beam", Needs.of([wanted]))
    assert wanted.ends(batch, smooth=True)[1] == wanted.largest


def test_slowest_mode_with_loops_closed_is_the_slowest_pole(triple):
    loops = sus.damp(triple)
    mechanical = np.array([not name.startswith("loop ") for name in loops.closed.state])
    slowest = -np.real(loops.closed.value[mechanical]).max()
    [settling] = evaluate(triple, "settling of modes")
    assert settling == pytest.approx(1 / slowest, rel=RELATIVE)


def test_margins_are_those_of_damp(triple):
    loops = sus.damp(triple)
    name = loops.loop[1]
    own = loops.margin[1]
    values = evaluate(
        triple, *(f"margin {name}.{w}" for w in ("gain", "phase", "delay", "distance"))
    )
    gain = min(own.gain_up_db, -own.gain_down_db)
    assert values == pytest.approx([gain, own.phase, own.delay, own.distance], rel=1e-6)


def test_responses_and_couplings_are_those_of_response(lossy):
    one, ratio = evaluate(lossy, "test.x/support.x:10", "test.x/test.pitch/support.x:10")
    asked = {"inputs": ["support.x"], "frequency": [10.0], "fidelity": "beam"}
    value = sus.response(lossy, outputs=["test.x", "test.pitch"], **asked).value[0, :, 0]
    assert one == pytest.approx(abs(value[0]), rel=RELATIVE)
    assert ratio == pytest.approx(abs(value[0] / value[1]), rel=RELATIVE)


def test_peak_is_that_of_a_dense_grid_around_the_resonance(lossy):
    """At a resonance of a single mode the largest magnitude lies within its width."""
    modes = sus.modes(lossy, fidelity="beam")
    n = list(modes.label).index("test longitudinal")
    f = modes.frequency[n]
    peak, least = evaluate(
        lossy,
        f"peak of test.x/support.x:{0.98 * f}:{1.02 * f}",
        "smallest of test.x/support.x:20:50",
    )
    width = f / modes.q[n]
    model = registry.BEAM.system(lossy.design)
    known = signals.bodies_with_signals(model)
    into, out = signals.parse_input("support.x", known), signals.parse_output("test.x", known)
    dense = f + width * np.linspace(-3, 3, 20001)
    found = np.abs(responses.solve(model, dense, [into], [out]).value[:, 0, 0])
    assert peak == pytest.approx(found.max(), rel=1e-6)
    band = np.linspace(20.0, 50.0, 2001)
    fall = np.abs(responses.solve(model, band, [into], [out]).value[:, 0, 0])
    assert least == pytest.approx(fall.min(), rel=1e-6)


def test_thermal_noise_is_that_of_thermal(lossy):
    [value] = evaluate(lossy, "thermal test.x:10")
    found = sus.thermal(lossy, outputs=["test.x"], frequency=[10.0], fidelity="beam")
    assert value == pytest.approx(found.amplitude[0, 0], rel=RELATIVE)


def test_force_noise_of_a_damped_pendulum_is_nyquists():
    """A body with a viscous damper c along x feels the force sqrt(4 k T c) (Nyquist)."""
    text = sus.template("single").text.replace(
        "[stage.wires]", "[stage.damping]\nx = 0.3\n[stage.wires]", 1
    )
    design = sus.parse(text)
    value, motion = evaluate(design, "force noise test.force_x:30", "thermal test.x:30")
    expected = math.sqrt(4 * 1.380649e-23 * design.constants.temperature * 0.3)
    assert value == pytest.approx(expected, rel=2e-3)  # wires have losses too
    assert motion > 0


def test_noise_and_rms_are_those_of_budget(triple):
    found = sus.budget(triple, outputs=["test.x"], frequency="0.05:10:400", fidelity="beam")
    density, rms = evaluate(triple, "noise test.x:10", "rms test.x:0.05:10")
    assert density == pytest.approx(found.amplitude[-1, 0], rel=RELATIVE)
    assert rms == pytest.approx(found.rms[0, 0], rel=1e-3)  # integrals from different points


def test_violin_modes_are_those_of_the_table(lossy):
    modes = sus.modes(lossy, max_frequency=700, fidelity="violin")
    own = [
        f
        for f, motion in zip(modes.frequency, modes.motion, strict=True)
        if motion.startswith("test violin") and motion.endswith(" 1")
    ]
    first, lowest = evaluate(lossy, "test violin 1", "lowest violin")
    assert first == pytest.approx(min(own), rel=1e-8)
    every = [f for f, order in zip(modes.frequency, modes.order, strict=True) if order]
    violins = [
        f for f, label in zip(modes.frequency, modes.label, strict=True) if "violin" in label
    ]
    assert len(every) >= len(violins)
    assert lowest == pytest.approx(min(violins), rel=1e-8)


def test_loads_are_those_of_check():
    design = sus.template("triple")
    statics = sus.check(design).statics
    texts = ("tension test.1", "stress test wires", "stress fraction test wires")
    stage = statics.blades[0].stage
    tension, stress, fraction, sag = evaluate(
        design, *texts, f"sag of {stage} blades", level="string"
    )
    own = [wire for wire in statics.wires if wire.stage == "test"]
    assert tension == pytest.approx(own[0].tension, rel=RELATIVE)
    assert stress == pytest.approx(max(wire.stress for wire in own), rel=RELATIVE)
    assert fraction == pytest.approx(max(wire.fraction for wire in own), rel=RELATIVE)
    blades = [blade.sag for blade in statics.blades if blade.stage == stage]
    assert sag == pytest.approx(max(blades), rel=RELATIVE)


def test_poses_are_those_of_check():
    offset = '[[perturbation]]\nbody = "test"\ncom_offset = [1e-4, 0.0, 0.0]\n'
    design = sus.parse(sus.template("single").text + offset)
    statics = sus.check(design).statics
    turn, height = evaluate(design, "test static pitch", "test height", level="string")
    assert turn == pytest.approx(statics.bodies[0].rotation[1], rel=1e-6)
    assert abs(turn) > 1e-5
    length = sus.template("single").stage[-1].wires.l
    assert 0.5 * length < height < 1.5 * length


def test_distance_and_top_fraction_follow_from_modes(lossy):
    modes = sus.modes(lossy, fidelity="beam")
    labels = list(modes.label)
    pitch, along = (labels.index(f"test {word}") for word in ("pitch", "longitudinal"))
    distance, top = evaluate(
        lossy, "distance test pitch, test longitudinal", "top fraction of test pitch"
    )
    ratio = modes.frequency[pitch] / modes.frequency[along]
    assert distance == pytest.approx(max(ratio, 1 / ratio) - 1, rel=LOSSLESS)
    assert top == pytest.approx(modes.top_fraction[pitch], rel=LOSSLESS)


def test_fractions_of_a_mode_are_those_of_modes_and_add_up_to_1(lossy):
    modes = sus.modes(lossy, fidelity="beam")
    number = list(modes.label).index("test pitch")
    motions = list(dict.fromkeys(names_of(lossy).labels))
    parts = evaluate(lossy, *(f"fraction of {one} in test pitch" for one in motions))
    assert max(parts) == pytest.approx(parts[motions.index("test pitch")], rel=RELATIVE)
    own = modes.energy[number].ravel()
    assert parts[motions.index("test pitch")] == pytest.approx(own.max(), rel=LOSSLESS)
    assert 0.5 < sum(parts) <= 1 + RELATIVE


def test_families_have_each_mode_once(lossy):
    modes = sus.modes(lossy, fidelity="beam")
    families = names_of(lossy).families
    texts = [
        f"{name} {rank + 1}"
        for name, size in zip(families.names, families.size, strict=True)
        for rank in range(size)
    ]
    assert families.names == ("longitudinal-pitch", "transverse-roll", "vertical", "yaw")
    values = evaluate(lossy, *texts)
    np.testing.assert_allclose(sorted(values), modes.frequency, rtol=LOSSLESS)
    yaw = [f for f, label in zip(modes.frequency, modes.label, strict=True) if "yaw" in label]
    np.testing.assert_allclose(values[-len(yaw) :], yaw, rtol=LOSSLESS)


def test_difference_is_that_of_two_modes(lossy):
    one, other, apart = evaluate(
        lossy, "yaw 1", "lowest vertical", "difference yaw 1, lowest vertical"
    )
    assert apart == pytest.approx(abs(one - other), rel=RELATIVE)


@pytest.mark.parametrize("name", ["test pitch", "lowest pitch"])
def test_a_search_sees_no_jump_where_modes_exchange_their_character(name):
    """Pitch is the upper mode of two for large d, and the lower one for small d."""
    design = sus.parse(SMALL)
    heights = np.linspace(2e-4, 2e-3, 1200)
    designs = [design.replace({D: d}).design for d in heights.tolist()]
    quantity = vocabulary.parse(name, names_of(design), "--result")
    [(_, batch)] = solved.of_designs(designs, "string", Needs.of([quantity]))
    low, high = quantity.ends(batch, smooth=True)
    value = quantity.values(batch)
    assert np.abs(np.diff(value)).max() > 0.07
    assert np.abs(np.diff(low)).max() < 0.01
    assert np.abs(np.diff(high)).max() < 0.01
    assert (low <= value * (1 + 1e-12)).all()
    assert (value <= high * (1 + 1e-12)).all()
    np.testing.assert_allclose(low[[0, -1]], high[[0, -1]], rtol=1e-12)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("peak of test.x/support.x:5:0.1", "has no band of frequencies"),
        ("Q of tset pitch", "is the label of no mode; did you mean 'test pitch'?"),
        ("decay of nothing", "is the label of no mode"),
        ("settling of pitch", "is the label of no mode"),
        ("Q of 99", "is no number of a mode; give 1 to 18"),
        ("Q of lowest nothing", "is no degree of freedom"),
        ("dilution of test pitch", "is not known: loops store and take energy"),
        ("tension tset.1", "names no wire or blade; did you mean 'test.1'?"),
        ("tension upper blades", "is a quantity of wires"),
        ("stress upper blades", "is not known: upper.blade1 has no geometry; give its geometry"),
        ("stress fraction nothing", "names no wire or blade"),
        ("sag of test wires", "is a quantity of blades"),
        ("margin pitch.size", "is no margin; write margin LOOP.gain|phase|delay|distance"),
        ("margin nothing.gain", "names no loop"),
        ("stable loops", "is no quantity of this design; did you mean 'stable'?"),
        ("top fraction of tset pitch", "is the label of no mode; did you mean 'test pitch'?"),
        ("fraction of pitch in test yaw", "names no motion of a stage"),
        ("fraction of test pitch", "names no mode; write fraction of test pitch in MODE"),
        ("distance test pitch", "does not name two modes"),
        ("difference test pitch, test pitch", "names one mode twice"),
        ("test pitch#99", "is more than the 18 modes of the design"),
        ("99", "is no number of a mode; give 1 to 18"),
        ("lowest nothing", "is no degree of freedom"),
        ("yaw 4", "is not one of the 3 modes of this family; give 1 to 3"),
        ("longitudinal 1", "names no family of modes that couple by symmetry"),
        ("noise test.x", "has no frequency; write noise MOTION:FREQUENCY"),
        ("rms nothing.x", "names no body"),
        ("test static speed", "is no static motion"),
        ("tset height", "names no stage; did you mean 'test'?"),
        ("test.x/support.x", "is no response; write OUTPUT/INPUT:FREQUENCY"),
        ("couplings", "is no quantity of this design; did you mean 'coupling'?"),
        ("thermal test.x:-1", "has no frequency; write thermal MOTION:FREQUENCY"),
        ("force noise test.x:1", "is no force or torque; write test.force_x"),
        ("test violin 0", "has no order from 1 to 100"),
        ("modes", "means every mode, not one quantity"),
    ],
)
def test_each_kind_says_what_is_wrong(triple, text, said):
    """In one line, with the name as it was given."""
    with pytest.raises(sus.InputError) as raised:
        vocabulary.parse(text, names_of(triple))
    [line] = str(raised.value).splitlines()
    assert said in line


@pytest.mark.parametrize("kind", vocabulary.every_kind(), ids=lambda kind: kind.pattern)
def test_no_kind_ignores_the_end_of_a_name(kind, triple):
    with pytest.raises(sus.InputError, match="nonsense"):
        vocabulary.parse(f"{kind.example} nonsense:", names_of(triple))


@pytest.mark.parametrize(
    ("low", "high", "value", "margin"),
    [
        (-math.inf, 1.0, 0.8, 0.2),
        (-math.inf, 1.0, 1.2, -0.2),
        (0.5, math.inf, 5.0, 9.0),
        (0.5, 2.0, 1.9, 0.05),
        (0.5, 2.0, 0.0, -1.0),
        (0.0, 2.0, 0.5, 0.25),  # from a limit of 0, relative to the other one
        (0.0, math.inf, 0.5, 0.5),
        (0.5, math.inf, math.inf, math.inf),
    ],
)
def test_a_margin_is_relative_to_the_nearer_limit(low, high, value, margin):
    limits = requirements.Limits("test pitch", low, high)
    found = requirements.find_one(limits, names_of(sus.template("triple")))
    assert float(found.margin(np.array(value))) == pytest.approx(margin, abs=1e-15)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("test.x/support.x:0.40111234", "test.x/support.x:0.40111235"),
        ("thermal test.x:1.00000001", "thermal test.x:1"),
        ("peak of test.x/support.x:0.1:5", "peak of test.x/support.x:0.1:5.0000001"),
    ],
)
def test_no_two_quantities_have_one_name(lossy, one, other):
    names = names_of(lossy)
    texts = [vocabulary.parse(text, names, "--result").text for text in (one, other)]
    assert texts == [one, other]


@pytest.mark.parametrize("written", ["test.x / support.x : 10.0", "test.x/support.x:10"])
def test_blanks_and_digits_of_a_name_do_not_matter(lossy, written):
    found = vocabulary.parse(written, names_of(lossy), "--result")
    assert found.text == "test.x/support.x:10"
    peak = vocabulary.parse("peak of test.x / support.x:0.10:5", names_of(lossy), "--result")
    assert peak.text == "peak of test.x/support.x:0.1:5"


def test_labels_that_modes_prints_are_quantities():
    """How many modes have a label depends on the model."""
    design = sus.example("cryogenic-payload")
    modes = sus.modes(design, fidelity="beam")
    twice = [name for name in modes.label if name.endswith("#2")]
    assert twice
    for name in twice:
        [value] = evaluate(design, name)
        number = modes.label.index(name)
        assert value == pytest.approx(modes.frequency[number], rel=1e-4), name


@pytest.mark.parametrize(
    ("low", "high", "value", "met"),
    [
        (-math.inf, 2e-3, -1e-3, True),
        (-math.inf, 2e-3, -3e-3, False),  # a positive largest value limits the magnitude
        (-math.inf, -1e-3, -2e-3, True),
        (1e-3, math.inf, -2e-3, False),
        (-1e-3, math.inf, -2e-3, False),
        (-3e-3, 1e-3, -2e-3, True),
    ],
)
def test_limits_of_a_quantity_with_a_sign(low, high, value, met):
    names = names_of(sus.template("triple"))
    found = requirements.find_one(requirements.Limits("test static pitch", low, high), names)
    assert bool(found.is_met(np.array(value))) is met
    assert (float(found.margin(np.array(value))) >= 0) is met


def test_a_count_can_be_swept():
    """The rate at which weak dampers take the amplitude away is proportional to their number."""
    magnet = {"shape": "plate", "axis": "x", "conductivity": 5.8e7, "thickness": 0.005}
    magnet |= {"gap": 0.02, "moment": 0.1}
    brake = {"name": "brake", "between": ["test", "support"], "eddy_current": magnet}
    design = sus.example("double").replace({"damper": [brake]})
    vary = {"damper.brake.eddy_current.count": [1, 2, 4]}
    found = sus.sweep(design, vary=vary, results=["decay of test longitudinal"], fidelity="string")
    rates = np.ravel(found.value)
    added = rates - rates[0]  # to the loss of the wires
    assert added[2] == pytest.approx(3 * added[1], rel=1e-3)


@pytest.mark.parametrize("ground", [None, "nlnm"])
def test_an_assumed_ground_is_said(ground, recwarn):
    design = sus.example("double")
    if ground:
        design = design.replace({"analysis.budget.ground": [ground]})
    sus.sensitivity(design, results=["noise test.x:10"], vary=["stage.test.wires.l"])
    said = [str(one.message) for one in recwarn if "the ground nhnm" in str(one.message)]
    assert len(said) == (ground is None)
