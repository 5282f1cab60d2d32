"""Suspensions that were built, held against what is known of them: `results/validation.md`.

`python -m tools.validation` (`make validation`) writes the page from `configs/built/` and
`measured/`, without a network. Each section is a module with a function `section()` that returns
a `page.Section`; `__main__` lists them.
"""
