"""Generate the tables of docs/design-file.md (keys, materials), docs/commands.md (usage, and on the
site options) and docs/api.md (stability of names), and the stub from which editors know the
functions of the analyses (suspension_cli/__init__.pyi).

Keys come from the types of the file format, options from `--help`, stability from docstrings. A
page marks the place of a table with `<!--keys:WireSet-->`, `<!--options:modes-->`,
`<!--materials:built-in-->` or `<!--stability:api-->`; the text from there to `<!--end-->` is
regenerated. Run by `make reference`; `tests/docs/test_reference.py` fails if a page is stale.
"""

from __future__ import annotations

import inspect
import re
import textwrap
import types
import typing
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import click
import msgspec

import suspension_cli as sus
from suspension_cli import errors
from suspension_cli.analyses.record import Origin
from suspension_cli.cli.main import COMMANDS, main
from suspension_cli.conventions import ANALYSES
from suspension_cli.design import (
    bodies,
    control,
    heat,
    imperfections,
    links,
    loop_filters,
    loop_sensors,
    materials,
    noise_spectra,
    required_quantities,
    schema,
    towers,
    wires,
)

ROOT = Path(__file__).parent.parent
PAGES = tuple(ROOT / "docs" / name for name in ("design-file.md", "commands.md", "api.md"))
BLOCK = re.compile(r"<!--(keys|options|materials|stability):([\w-]+)-->\n.*?<!--end-->", re.DOTALL)
STUB = ROOT / "suspension_cli" / "__init__.pyi"
MODULES = (
    schema,
    bodies,
    control,
    heat,
    imperfections,
    noise_spectra,
    required_quantities,
    wires,
    links,
    loop_filters,
    loop_sensors,
    towers,
    materials,
)
"""Modules with the types of tables."""
TYPES = {
    name: next(found for module in MODULES if (found := getattr(module, name, None)))
    for name in schema.json_schema()["$defs"]
}
"""Tables of the file format, by name."""
USUAL = {
    *("overrides", "ties", "out", "stem", "fidelity", "as_json", "as_csv", "plot"),
    *("picture_format", "quiet", "verbose", "watch"),
}
"""Parameters of most analyses, whose options the head of docs/commands.md explains once."""
LIKE = {
    "BodyPart": (bodies.Solid, "`body`"),
    "Wire": (wires.AnyWire, "`[stage.wires]`"),
    "Blade": (wires.AnyBlade, "`[stage.blades]`"),
}
"""Tables whose keys from a common base are described in another table: the base, and the heading of
the other in docs/design-file.md."""

NOISE = "`{ asd, corner, frequency, file, column, source }`"
BRIEF = {
    f"number or text or 2 rows of numbers or {NOISE}, default `0.0`": "noise",
    "number, default ": "",
    "whole number, required": "whole, required",
    "number, required": "required",
    "3 numbers, default `[0.0,0.0,0.0]`": "`[0.0,0.0,0.0]`",
    "number or `{ temperature, values }`": "property",
    "text or table": "filter",
    "`true`, `false`, default `": "`",
    'a Foton string: zpk([z;z],[p;p],k,"n"), gain(k), pole(f,"n"), ... and products of these': (
        "a Foton string"
    ),
    "as a Foton string; or a digital filter: sections of a Foton filter file": "",
    "a Foton string; or a digital filter": "",
    ": a Foton string": "",
    ": flat, a known sensor, [[f, asd], ...], a table, or a file": "",
    ", in the forms of sensor_noise": "",
    ", in the forms of that of a loop": "",
    " of the wire's ": " of the ",
    " of the body's ": " of the ",
    " along x, y and z, m (each axis)": ", m (each axis)",
    " along x, y, z, m": ", m",
    " about x, y, z, rad": ", rad",
    "letters, digits, _ and -, starting with a letter": "",
    "the two bodies: a stage first, then another stage,"
    ' "support" (the suspension point) or "ground" (beside it)': "the two bodies",
    "the common point, from the COM of the first body, nominal pose, m": "from the first COM, m",
    "it may give power to the motion, as a sensor with an actuator does; otherwise negative damping"
    " and loss are refused": "",
    '"loaded-length": the wire is trimmed to its nominal tension in the nominal pose;'
    ' "natural-length": its unstretched length stays': "",
    "x, y, z, roll, pitch, yaw at the point, or a full 6x6: N/m, N m/rad": "or 6x6",
    "x, y, z, roll, pitch, yaw at the point, or a full 6x6: N s/m, N m s/rad": "or 6x6",
    "six elements or a full 6x6: N s/m, N m s/rad": "or 6x6",
    "a stage's name, instead of a wire": "a stage",
    "a stage's name": "",
    "the name of a link": "a link",
    "measured diameter: a CSV file, { file, error } or { position, diameter, error }": (
        "measured diameter"
    ),
    "name of a material, built in or of [materials]": "built in or of [materials]",
    "name of a quantity, such as": "such as",
    "; with a cross-section: k = E A / l": "",
    "in K; of both ends, { upper, lower }, linear in between; or a profile [[0.0, 16.0], [1.0,"
    " 23.0]]: fraction of the length from the upper end, and K": (
        "in K ([forms](wires.md#temperature))"
    ),
    '"wire": along the nominal wire; "bending-point": the ends are the effective bending points; or'
    " directions { upper, lower }": "what the ends are, or directions of the clamps",
    "number of wires: 1, 2 or 4": "1, 2 or 4",
    "number of blades, 1, 2 or 4": "1, 2 or 4",
    ", in the quantity's unit": "",
}
"""Values and meanings of keys that occur in many tables: docs/design-file.md explains them once."""


def brief(text: str) -> str:
    """Shorten what the head of docs/design-file.md explains."""
    for long, short in BRIEF.items():
        text = text.replace(long, short)
    return "" if text == "number" else text.strip(",;: ")


def page(text: str) -> str:
    """Regenerate the tables of a page."""
    makers = {"keys": keys, "options": options, "materials": built_in, "stability": stability}
    return BLOCK.sub(
        lambda found: f"<!--{found[1]}:{found[2]}-->\n\n{makers[found[1]](found[2])}\n\n<!--end-->",
        text,
    )


def table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """Format a Markdown table without columns that are empty in all rows."""
    kept = [n for n, title in enumerate(head) if n == 0 or not rows or any(row[n] for row in rows)]
    lines = [
        [head[n] for n in kept],
        *([row[n].replace("|", r"\|") for n in kept] for row in rows),
    ]
    first, *others = ("| " + " | ".join(line) + " |" for line in lines)
    return "\n".join((first, "|" + "---|" * len(kept), *others))


def keys(name: str) -> str:
    """Tabulate the keys of a table of the file format: values with their default, and meaning.

    Keys with the same values, default and meaning share a row; of those of a table in `LIKE` the
    last row names the first and the last.
    """
    kind = TYPES[name]
    base, heading = LIKE.get(name, (None, ""))
    known = set(base.__struct_fields__) if base else set()
    hints = get_type_hints(kind, include_extras=True)
    rows = []
    private = (one for one in kind.__mro__ if one is kind or one.__name__.startswith("_"))
    own = {key for one in private for key in getattr(one, "__annotations__", ())}
    fields = msgspec.structs.fields(kind)  # those that tables share after those of its own
    for field in sorted(fields, key=lambda field: not (field.required or field.name in own)):
        if field.name in known:
            continue
        hint = hints[field.name]
        given = ", required" if field.required else default(field.default)
        values = takes(hint)
        meaning = "" if values == "table" else description(hint)  # a section describes the table
        row = (brief(values + given), brief(meaning))
        if rows and rows[-1][1:] == row:
            rows[-1] = (f"{rows[-1][0]}, `{field.name}`", *row)
        else:
            rows.append((f"`{field.name}`", *row))
    if base:
        first, *_, last = base.__struct_fields__
        rows.append((f"`{first}` to `{last}`", f"as in {heading}", ""))
    return table(("key", "takes", "meaning"), rows)


ROOM = 290.0
"""Temperature in K of the tables of built-in materials."""


def number(value: materials.Property | None) -> str:
    """Format a number, of a property against temperature that at 290 K; empty if it is unknown."""
    if value is not None:
        value = materials.value_at(value, ROOM)
    return "" if value is None else f"{value:g}".replace("e+0", "e").replace("e+", "e")


def built_in(_: str) -> str:
    """Tabulate the built-in materials."""
    columns = {
        "youngs_modulus": "Young's modulus, Pa",
        "density": "density, kg/m³",
        "tensile_strength": "tensile strength, Pa",
    }
    rows = [
        (name, *(number(getattr(material, key)) for key in columns))
        for name, material in materials.BUILT_IN.items()
    ]
    return table(("material", *columns.values()), rows)


def default(value: Any) -> str:
    """Describe a default as written in the file; empty if the key is simply absent."""
    if (
        value is None
        or value is msgspec.NODEFAULT
        or value == ""
        or isinstance(value, msgspec.Struct)
    ):
        return ""
    return f", default `{msgspec.json.encode(value).decode()}`"


def bare(hint: Any) -> tuple[Any, list[msgspec.Meta]]:
    """Split a type from its annotations, the innermost first."""
    if get_origin(hint) is Annotated:
        inner, *extras = get_args(hint)
        kind, metas = bare(inner)
        return kind, [*metas, *(extra for extra in extras if isinstance(extra, msgspec.Meta))]
    return hint, []


def choices(kind: Any) -> list[Any]:
    """List the members of a union other than None; for another type, the type alone."""
    return (
        [choice for choice in get_args(kind) if choice is not type(None)]
        if get_origin(kind) in (Union, types.UnionType)
        else [kind]
    )


def takes(hint: Any) -> str:
    """Describe the values of a key."""
    kind, metas = bare(hint)
    found = choices(kind)
    if len(found) > 1 or found[0] is not kind:
        return " or ".join(dict.fromkeys(takes(choice) for choice in found))
    if get_origin(kind) is Literal:
        return ", ".join(f"`{msgspec.json.encode(option).decode()}`" for option in get_args(kind))
    if get_origin(kind) is tuple:
        if get_args(kind)[-1] is Ellipsis:
            return "numbers"
        return f"{len(get_args(kind))} numbers"
    if get_origin(kind) is list:
        return list_of(bare(get_args(kind)[0])[0], metas)
    if get_origin(kind) is dict:
        return "numbers by name" if bare(get_args(kind)[1])[0] is float else "tables"
    if kind is schema.Distribution:
        return "distribution"
    if issubclass(kind, msgspec.Struct):
        return (
            f"`{{ {', '.join(kind.__struct_fields__)} }}`"
            if len(kind.__struct_fields__) <= 6
            else "table"
        )
    named = any(meta.pattern for meta in metas)
    return {
        float: "number",
        int: "whole number",
        bool: "`true`, `false`",
        str: "name" if named else "text",
    }[kind]


def list_of(item: Any, metas: list[msgspec.Meta]) -> str:
    """Describe the items of a list: tables, or numbers or names (how many, if fixed)."""
    if any(
        isinstance(choice, type) and issubclass(choice, msgspec.Struct) for choice in choices(item)
    ):
        return "tables"
    low, high = (
        next((getattr(meta, bound) for meta in reversed(metas) if getattr(meta, bound)), None)
        for bound in ("min_length", "max_length")
    )
    inner, inside = bare(item)
    if get_origin(inner) is list:
        return f"{low or ''} rows of {list_of(get_args(inner)[0], inside)}".strip()
    kind = "names" if item is str else "numbers"
    return f"{low} {kind}" if low == high and low else kind


def description(hint: Any) -> str:
    """Describe a key in the words of its outermost annotation or of the table it takes."""
    kind, metas = bare(hint)
    meaning = next((meta.description for meta in reversed(metas) if meta.description), None)
    for choice in [] if meaning else choices(kind):
        inner, inside = bare(choice)
        meaning = next((meta.description for meta in reversed(inside) if meta.description), None)
        if meaning is None and isinstance(inner, type) and issubclass(inner, msgspec.Struct):
            meaning = str(inner.__doc__).partition("\n")[0].rstrip(".")
            meaning = meaning[0].lower() + meaning[1:]
        if meaning:
            break
    text = meaning or ""
    for plain, set_in_type in (
        ("^2", "²"),
        ("^3", "³"),
        ("2 pi", "2π"),
        ("sqrt(Hz)", "√Hz"),
    ):
        text = text.replace(plain, set_in_type)
    return text


def options(name: str) -> str:
    """Format usage of a command; the site has `table_of_options` instead."""
    return f"{_options(name)[0]}."


def table_of_options(name: str) -> str:
    """Format usage and options of a command as `--help` has them."""
    usage, rows, is_usual = _options(name)
    more = ["Also those of all analyses."] if is_usual else []
    return "\n\n".join([usage, *([table(("option", "meaning"), rows)] if rows else []), *more])


def expand(text: str) -> str:
    """Put tables of options, with their meanings, into a page of the site."""
    return BLOCK.sub(
        lambda found: table_of_options(found[2]) if found[1] == "options" else found[0], text
    )


def _options(name: str) -> tuple[str, list[tuple[str, str]], bool]:
    """Usage, options with their help, and whether it also has those of all analyses."""
    command = main.get_command(click.Context(main), name)
    if command is None:
        raise KeyError(name)
    context = click.Context(command, info_name=f"pendsus {name}")
    is_usual = {param.name for param in command.params} >= USUAL
    shown = [
        param.get_help_record(context)
        for param in command.params
        if isinstance(param, click.Option) and not (is_usual and param.name in USUAL)
    ]
    rows = [(f"`{record[0]}`", " ".join(record[1].split())) for record in shown if record]
    usage = f"`{context.command_path} {' '.join(command.collect_usage_pieces(context))}`"
    return usage, rows, is_usual


def stability(_: str) -> str:
    """List the public names: stable, or provisional where the docstring says so."""
    names: dict[str, list[str]] = {"stable": [], "provisional": []}
    for name in sus.__all__:
        if not name.startswith("_"):
            text = inspect.getdoc(getattr(sus, name)) or ""
            names["provisional" if "\nProvisional: " in text else "stable"].append(f"`{name}`")
    rows = [(kind, ", ".join(found)) for kind, found in names.items()]
    return table(("stability", "names"), rows)


MEMBERS = {
    "Design": "name, replace, foton",
    "Record": "design, model, estimated_error, document, figures, plot, save, to_xarray",
    "Report": "path, title",
}
"""Methods of public classes that the site describes, besides the attributes of all records."""


def documented_names() -> str:
    """Format the end of docs/api.md on the site: docstrings of all functions and records."""
    found: dict[str, list[str]] = {"Functions": [], "Records": []}
    for name in sus.__all__:
        item = getattr(sus, name)
        if inspect.isfunction(item):
            found["Functions"].append(f".. autofunction:: suspension_cli.api.{name}")
        elif inspect.isclass(item) and not issubclass(item, (Exception, Warning)):
            found["Records"] += _documented_class(item)
    found["Records"] += _documented_class(Origin)
    sections = (
        "\n".join((f"## {head}", "", "```{eval-rst}", *lines, "```", ""))
        for head, lines in found.items()
    )
    return "\n" + "\n".join(sections)


def _documented_class(kind: type) -> list[str]:
    members = MEMBERS.get(kind.__name__)
    return [
        f".. autoclass:: {kind.__module__}.{kind.__name__}",
        *([f"   :members: {members}"] if members else []),
        "   :exclude-members: __init__",
    ]


def stub() -> str:
    """Stub of the package: the functions of analyses with signatures and docstrings."""
    homes = sorted({"Record": "record", **sus.RECORDS}.items(), key=lambda item: item[1])
    lines = [
        '"""The public API, for editors and type checkers; made by `make reference`."""',
        "",
        "from collections.abc import Mapping",
        "from pathlib import Path",
        "from typing import Any",
        "",
        "from suspension_cli import api, errors",
        *(f"from suspension_cli.analyses.{home} import {name} as {name}" for name, home in homes),
        "from suspension_cli.api import Design as Design, Grid, Names, PathLike, Paths",
        "",
        "__version__: str",
    ]
    for name in sus.__all__:
        if name in ANALYSES:
            function, keyword_only = getattr(sus, name), False
            lines += ["", f"def {name}("]
            for each in inspect.signature(function).parameters.values():
                if each.kind is each.KEYWORD_ONLY and not keyword_only:
                    keyword_only = True
                    if "*items" not in lines[-1]:
                        lines.append("    *,")
                star = "*" if each.kind is each.VAR_POSITIONAL else ""
                given = "" if each.default is each.empty else f" = {each.default!r}"
                lines.append(f"    {star}{each.name}: {each.annotation}{given},")
            text = textwrap.indent(inspect.getdoc(function) or "", "    ")
            returned = inspect.signature(function).return_annotation
            kinds = typing.get_args(returned) or (returned,)
            names = " | ".join(getattr(kind, "__name__", kind) for kind in kinds)
            lines += [
                f") -> {names}:",
                f'    """{text.strip()}',
                '    """',
            ]
        elif not name.startswith("_") and name not in ("Record", "Design", *sus.RECORDS):
            lines.append(f"{name} = {'errors' if hasattr(errors, name) else 'api'}.{name}")
    return re.sub(r"[ \t]+\n", "\n", "\n".join(lines)) + "\n"


def main_pages() -> None:
    """Regenerate the tables of all pages, and the stub."""
    STUB.write_text(stub(), encoding="utf-8")
    for path in PAGES:
        old = path.read_text(encoding="utf-8")
        new = page(old)
        if new != old:
            path.write_text(new, encoding="utf-8")
        missing = [
            f"pendsus {name}"
            for name in COMMANDS
            if path.name == "commands.md" and f"<!--options:{name}-->" not in new
        ]
        if missing:
            raise SystemExit(
                f"{path.relative_to(ROOT)}: no table of options for {', '.join(missing)}; write"
                " <!--options:NAME--> and <!--end-->"
            )


if __name__ == "__main__":
    main_pages()
