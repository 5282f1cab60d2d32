"""Tables of TOML with comments, as a person writes them."""

from __future__ import annotations

import json
import re
from typing import Any


def table(head: str, keys: dict[str, Any], comment: str = "", **comments: str) -> list[str]:
    """Lines of a table, after an empty one; `comments` stand beside their keys."""
    lines = ["", f"[{head}]" + (f"  # {comment}" if comment else "")]
    for key, value in keys.items():
        text = repr(value) if key == "phase" else _value(value)  # rounding spoils its symmetry
        lines.append(f"{key} = {text}" + (f"  # {comments[key]}" if comments.get(key) else ""))
    return lines


def _value(value: Any) -> str:
    if isinstance(value, bool | str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {_value(one)}' for key, one in value.items())} }}"
    if isinstance(value, int):
        return str(value)
    if not isinstance(value, float):
        return f"[{', '.join(map(_value, value))}]"
    mantissa, _, power = f"{value:.8e}".partition("e")
    if -4 <= int(power) < 6:
        return repr(float(f"{value:.9g}"))
    return f"{mantissa.rstrip('0').rstrip('.')}e{int(power)}"


def plain(text: str, most: int = 60) -> str:
    """Text for a comment or a title: printable characters in one line."""
    return "".join(one if one.isprintable() else " " for one in text)[:most].strip()


def word(text: str, default: str) -> str:
    """Name of a table: letters, digits, _ and -, starting with a letter."""
    bare = re.sub(r"[^A-Za-z0-9_]+", "-", text).strip("-")[:60]
    return bare if re.match(r"[A-Za-z]", bare) else f"{default}-{bare}".rstrip("-")
