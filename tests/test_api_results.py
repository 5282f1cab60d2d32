"""Results of the public API: copied, pickled, compared, and independent of changed files."""

from __future__ import annotations

import copy
import gc
import pickle

import pytest

import suspension_cli as sus
from suspension_cli.analyses.labelled import write_csv

SINGLE = sus.template("single")
LONGER = SINGLE.replace({"stage.test.wires.l": 1.0})


def coupling(design=SINGLE):
    return sus.xcouple(design, sweep={"k": [0.9, 1.1]}, fidelity="string")


def test_results_are_compared_by_identity():
    one, other = (sus.modes(SINGLE, fidelity="string") for _ in range(2))
    assert one == one and one != other and len({one, other}) == 2


def test_results_with_losses_are_pickled():
    design = sus.example("geo-silica-triple")
    found = sus.response(design, frequency=[1.0, 10.0], fidelity="beam")
    again = pickle.loads(pickle.dumps(found))
    assert again.document() == found.document() and str(again) == str(found)
    assert again.plot() is not None


def test_a_loaded_result_does_not_change_with_its_file(tmp_path):
    path = tmp_path / "r.h5"
    found = sus.modes(SINGLE, fidelity="string")
    found.save(path)
    again = sus.load(path)
    sus.modes(LONGER, fidelity="string").save(path)
    assert again.to_xarray().identical(found.to_xarray())
    again.save(tmp_path / "copy.h5")
    assert sus.load(tmp_path / "copy.h5").document() == found.document()
    path.unlink()
    assert again.to_xarray().identical(found.to_xarray())


def test_a_loaded_design_is_replaced(tmp_path):
    sus.modes(SINGLE, fidelity="string").save(tmp_path / "r.h5")
    source = sus.load(tmp_path / "r.h5").source
    assert source.replace({"stage.test.wires.l": 1.0}).design == LONGER.design


def test_a_sweep_refuses_a_file_that_is_not_its_own(tmp_path):
    path = tmp_path / "r.h5"
    coupling().save(path)
    again = sus.load(path)
    assert again.to_xarray().sizes["k"] == 2
    coupling(LONGER).save(path)
    with pytest.raises(sus.InputError, match=r"r\.h5: was replaced by another file"):
        again.to_xarray()
    path.unlink()
    with pytest.raises(sus.InputError, match=r"r\.h5: was deleted"):
        again.save(tmp_path / "copy.h5")
    assert again.document() and again.plot() is not None


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy])
def test_copies_of_a_sweep_keep_its_temporary_file(duplicate):
    found = coupling()
    again, path = duplicate(found), found.file
    del found
    gc.collect()
    assert again.to_xarray().sizes["k"] == 2
    del again
    gc.collect()
    assert not path.parent.exists()


def test_csv_is_that_of_the_command(tmp_path):
    found = sus.modes(SINGLE, fidelity="string")
    found.save(tmp_path / "found.csv")
    (expected,) = write_csv(found, tmp_path / "command.h5")
    text = (tmp_path / "found.csv").read_text()
    assert text == expected.read_text()
    assert len(text.splitlines()) == 1 + len(found.frequency)


def test_pictures_are_no_results_files(tmp_path):
    with pytest.raises(sus.InputError, match=r"path = .*m\.png: .*plot\(\)\.savefig"):
        sus.modes(SINGLE, fidelity="string").save(tmp_path / "m.png")
    assert not list(tmp_path.iterdir())
