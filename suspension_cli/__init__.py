"""pendsus: linear models of the pendulums that hang mirrors, from one TOML file."""

__version__ = "0.1.0"
