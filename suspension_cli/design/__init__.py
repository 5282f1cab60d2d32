"""From a TOML file to a scene: the file format, its checks, and the geometry it stands for."""
