"""What a shell offers where Tab is pressed: commands, options, files, paths, signals, labels."""

from __future__ import annotations

import pytest
from click.shell_completion import BashComplete, FishComplete, ZshComplete

from suspension_cli.cli.main import main
from tests.support.paths import CONFIGS

DOUBLE = str(CONFIGS / "double.toml")


def offered(*words, kind=BashComplete):
    """Words offered for the last, incomplete one; of files and folders their kind."""
    shell = kind(main, {}, "pendsus", "_PENDSUS_COMPLETE")
    items = shell.get_completions(list(words[:-1]), words[-1])
    return [item.value if item.type == "plain" else item.type for item in items]


@pytest.mark.parametrize("kind", [BashComplete, ZshComplete, FishComplete])
def test_commands_options_and_values(kind):
    assert offered("mo", kind=kind) == ["modes"]
    assert offered("modes", DOUBLE, "--fid", kind=kind) == ["--fidelity"]
    assert offered("modes", DOUBLE, "--fidelity", "v", kind=kind) == ["violin"]
    shell = kind(main, {}, "pendsus", "_PENDSUS_COMPLETE")
    assert "_PENDSUS_COMPLETE" in shell.source()


def test_files_and_folders_are_left_to_the_shell():
    assert offered("modes", "") == ["file"]
    assert offered("optimise", DOUBLE, "goals/") == ["file"]
    assert offered("modes", DOUBLE, "--out", "") == ["dir"]
    assert offered("response", DOUBLE, "--measured", "") == ["file"]
    assert offered("import", "") == offered("import", "ifo.yaml", "") == ["file"]


def test_paths_of_the_design():
    found = offered("modes", DOUBLE, "--set", "stage.test.wires.")
    assert "stage.test.wires.radius=" in found
    assert found == offered("sweep", DOUBLE, "--vary", "stage.test.wires.")
    assert offered("modes", DOUBLE, "--set", "stage.upper.body.si") == ["stage.upper.body.size="]


def test_signals():
    motions = offered("response", DOUBLE, "--output", "test.")
    assert motions == [f"test.{dof}" for dof in ("x", "y", "z", "roll", "pitch", "yaw")]
    assert offered("response", DOUBLE, "--input", "test.torque_y") == ["test.torque_yaw"]
    assert offered("response", DOUBLE, "--input", "support.r") == ["support.roll"]


def test_labels_of_quantities():
    assert offered("sweep", DOUBLE, "--result", "test p") == ["test pitch"]
    assert offered("tolerance", DOUBLE, "--result", "Q of upper y") == ["Q of upper yaw"]


def test_without_a_readable_design_nothing_is_offered(tmp_path):
    broken = tmp_path / "broken.toml"
    broken.write_text("[")
    assert offered("response", "--output", "test.") == []
    assert offered("response", str(broken), "--output", "test.") == []
