"""Changes of TOML texts: the values are the wanted ones, and all else stays as it was."""

import copy
import difflib
import tomllib

import pytest
import tomli_w
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import suspension_cli as sus
from suspension_cli.design import paths
from suspension_cli.design.toml_edits import rewritten, same

TEXT = """\
# a pendulum, drawn on paper first
title   = 'double'  # the working title

[design]
name = "mine"

[[stage]]
name = "upper"
body.mass = 12.0      # weighed
body.inertia = [
    0.1,  # roll
    0.2,
    0.3   # yaw
]

  [stage.wires]       # two
  d = 1e-3            # drawn wire
  "odd key" = { a = 1, b.c = [1, 2] }  # kept

[[stage]]
name = "test" # the mirror
[stage.blades.loss]
angle = 1e-4

[[link]]
name = "cable"  """

CHANGES = [
    ("stage.test.blades.loss.angle", 2e-4, ["angle = 1e-4"], ["angle = 0.0002"]),
    ("title", "new", None, ['title   = "new"     # the working title']),
    ("stage.upper.body.mass", 13.5, None, ["body.mass = 13.5      # weighed"]),
    ("stage.upper.body.inertia.3", 0.4, None, ["    0.4   # yaw"]),
    ("stage.upper.body.shape", "box", [], ['body.shape = "box"']),
    ("stage.upper.wires.count", 2, [], ["  count = 2"]),
    ("stage.upper.wires.odd key.b.c.1", 7, None, ['  "odd key" = { a = 1, b.c = [7, 2] }  # kept']),
    ("stage.upper.wires.odd key.b.d", 7, None, None),
    ("stage.test.blades.count", 3, [], ["[stage.blades]", "count = 3", ""]),
    ("stage.test.wires", {"d": 1.0}, [], ["wires = { d = 1.0 }"]),
    (
        "stage.upper.wires",
        {"d": 2e-3},
        ["  d = 1e-3            # drawn wire", '  "odd key" = { a = 1, b.c = [1, 2] }  # kept'],
        ["  d = 0.002           # drawn wire"],
    ),
    ("gas.pressure", 1e-3, [], ["", "[gas]", "pressure = 0.001"]),
    (
        "materials.steel.youngs_modulus",
        1.66e11,
        [],
        ["", "[materials.steel]", "youngs_modulus = 1.66e11"],
    ),
    ("link.cable.x", 1, [], ["x = 1"]),
]


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
@pytest.mark.parametrize(("path", "value", "gone", "new"), CHANGES)
def test_only_the_changed_value_changes(path, value, gone, new, newline):
    raw = tomllib.loads(TEXT)
    changed = paths.changed(raw, path.split("."), lambda _: value)
    found = rewritten(TEXT.replace("\n", newline), changed)
    assert tomllib.loads(found) == changed
    assert found.count("\n") == found.count(newline)
    before, after = TEXT.splitlines(), found.splitlines()
    steps = [one for one in difflib.ndiff(before, after) if one[0] in "+-"]
    lost = [one[2:] for one in steps if one[0] == "-"]
    assert len(lost) <= 1 if gone is None else lost == gone
    if new is not None:
        assert [one[2:] for one in steps if one[0] == "+"] == new


# Random documents in random layouts.

PATIENT = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}

KEYS = st.sampled_from(["a", "b", "c-1", "odd key", "d.e", 'q"', "1"])
SCALARS = st.one_of(
    st.integers(-9, 9),
    st.floats(allow_nan=False),
    st.booleans(),
    st.sampled_from(["", "plain", 'x = "1" # no', "two\nlines", "]}'\\"]),
    st.dates(),
    st.datetimes(allow_imaginary=False).map(lambda one: one.replace(fold=0)),
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=8,
)
TABLES = st.dictionaries(
    KEYS, VALUES | st.lists(st.dictionaries(KEYS, VALUES, max_size=3), max_size=3), max_size=4
)


def key_text(key):
    return tomli_w.dumps({key: 0})[:-5]


def written_value(draw, value):
    gap = draw(st.sampled_from(["", " ", "  "]))
    if isinstance(value, dict):
        pairs = [
            f"{gap}{name} = {written_value(draw, one)}{gap}" for name, one in dotted(draw, value)
        ]
        return f"{{{','.join(pairs)}}}"
    if isinstance(value, list):
        gap = draw(st.sampled_from(["", " ", "\n  ", " # ] } said\n\n"]))
        end = draw(st.sampled_from(["", ","])) if value else ""
        return f"[{gap}{f',{gap}'.join(written_value(draw, one) for one in value)}{end}{gap}]"
    if isinstance(value, str) and draw(st.booleans()):
        return f'"""\n{tomli_w.dumps({"x": value})[5:-2]}"""'
    if isinstance(value, str) and draw(st.booleans()) and not {"'", "\n"} & set(value):
        return f"'{value}'"
    return tomli_w.dumps({"x": value})[4:-1]


def dotted(draw, table):
    """Keys and values of a table, some of its own tables by dotted keys."""
    for key, value in table.items():
        if isinstance(value, dict) and value and draw(st.booleans()):
            for name, one in dotted(draw, value):
                yield f"{key_text(key)}.{name}", one
        else:
            yield key_text(key), value


def sections(draw, table, head):
    """Lines of a table, then those of its own tables that have headers."""
    below = {
        key: value
        for key, value in table.items()
        if (isinstance(value, dict) or (value and is_tables(value))) and draw(st.booleans())
    }
    here = {key: value for key, value in table.items() if key not in below}
    implied = head and below and not here and draw(st.booleans())
    implied = implied and not head[0].startswith("[[")
    lines = [] if implied else list(head)
    for name, value in dotted(draw, here):
        comment = draw(st.sampled_from(["", "  # why", "#"]))
        lines += draw(st.sampled_from([[], [""], ["# a remark"]]))
        indent = draw(st.sampled_from(["", "  "]))
        lines.append(f"{indent}{name} = {written_value(draw, value)}{comment}")
    name = head[0].strip("[]") if head else ""
    for key, value in below.items():
        path = ".".join(filter(None, [name, key_text(key)]))
        if isinstance(value, dict):
            lines += sections(draw, value, [f"[{path}]"])
        for one in value if isinstance(value, list) else ():
            lines += sections(draw, one, [f"[[{path}]]"])
    return lines


def is_tables(value):
    return isinstance(value, list) and all(isinstance(one, dict) for one in value)


@st.composite
def texts(draw):
    newline = draw(st.sampled_from(["\n", "\r\n"]))
    lines = sections(draw, draw(TABLES), [])
    whole = "\n".join(lines) + draw(st.sampled_from(["", "\n"]))
    return whole.replace("\n", newline)


def places(node, path=()):
    """All places of a document: the holders of a value, and its key."""
    found = []
    for key, value in node.items() if isinstance(node, dict) else enumerate(node):
        found.append((path, key))
        if isinstance(value, (dict, list)):
            found += places(value, (*path, key))
    return found


@st.composite
def changes(draw):
    """A text, and another document."""
    text = draw(texts())
    raw = tomllib.loads(text)
    for _ in range(draw(st.integers(0, 3))):
        known = places(raw)
        if not known or draw(st.integers(0, 3)) == 0:
            raw[draw(KEYS)] = draw(VALUES)
            continue
        path, key = draw(st.sampled_from(known))
        node = raw
        for one in path:
            node = node[one]
        match draw(st.sampled_from(["set", "set", "remove", "add", "grow"])):
            case "set":
                node[key] = draw(VALUES)
            case "remove":
                del node[key]
            case "add" if isinstance(node, dict):
                node[draw(KEYS)] = draw(VALUES)
            case "grow" if isinstance(node[key], list):
                node[key].append(draw(VALUES))
    return text, raw


@settings(max_examples=200, **PATIENT)
@given(changes())
def test_the_text_reads_as_the_changed_document(case):
    text, raw = case
    found = rewritten(text, copy.deepcopy(raw))
    assert same(tomllib.loads(found), raw)
    if same(tomllib.loads(text), raw):
        assert found == text


@settings(max_examples=50, **PATIENT)
@given(texts(), st.data())
def test_lines_without_the_changed_value_stay(text, data):
    raw = tomllib.loads(text)
    known = [
        (path, key)
        for path, key in places(raw)
        if isinstance(value_in(raw, (*path, key)), (int, float, bool))
    ]
    if not known:
        return
    path, key = data.draw(st.sampled_from(known))
    value_in(raw, path)[key] = 123456.5
    before = text.splitlines(keepends=True)
    after = rewritten(text, raw).splitlines(keepends=True)
    assert same(tomllib.loads("".join(after)), raw)
    assert len(before) == len(after)
    assert sum(one != other for one, other in zip(before, after, strict=True)) == 1


def value_in(raw, path):
    for key in path:
        raw = raw[key]
    return raw


def test_a_changed_design_keeps_the_comments_of_its_file(tmp_path):
    file = tmp_path / "a.toml"
    text = sus.template("double").text.replace("[design]", "# drawn on paper first\r\n[design]")
    file.write_bytes(text.encode())
    design = sus.read(file)
    assert design.text == text
    new = design.replace({"stage.test.wires.d": 0.002})
    new.save(tmp_path / "b.toml")
    written = (tmp_path / "b.toml").read_bytes().decode()
    old_lines = text.splitlines(keepends=True)
    new_lines = written.splitlines(keepends=True)
    changed = [pair for pair in zip(old_lines, new_lines, strict=True) if pair[0] != pair[1]]
    assert [new.partition("#")[0].split() for _, new in changed] == [["d", "=", "0.002"]]
    assert sus.read(tmp_path / "b.toml").stage[-1].wires.d == 0.002
    assert sus.read(file, "stage.test.wires.d=0.002").text == written
