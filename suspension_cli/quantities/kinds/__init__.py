"""Kinds of quantities, one file each: `vocabulary` finds every `KINDS` in this folder."""
