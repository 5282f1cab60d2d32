"""Design files: format, units, checks, overrides, materials; files of measured modes and goals."""

DETECTORS = {
    "kagra-typea": ("built/kagra-typea", "KAGRA's cryogenic mirror: tower and payload"),
    "kagra-typeb": ("built/kagra-bs-2019", "KAGRA's beam splitter: tower on an inverted pendulum"),
    "kagra-typebp": ("built/kagra-pr3", "KAGRA's power recycling mirror PR3: two filters"),
    "ligo-quad": ("built/ligo-quad", "Advanced LIGO's quadruple pendulum, production model"),
    "ligo-fibres": ("built/ligo-test-mass", "Advanced LIGO's last stage: mirror on silica fibres"),
    "ligo-initial": ("built/ligo-initial", "initial LIGO's mirror in a loop of wire"),
    "caltech-40m": (
        "built/caltech-40m-sos",
        "mirror of Caltech's 40 m prototype in a loop of wire",
    ),
    "geo-triple": ("geo-silica-triple", "triple pendulum with silica fibres, as in GEO 600"),
}
"""Short names of examples that are suspensions of detectors: example in `configs/`, line of help.
"""
