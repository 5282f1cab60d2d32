# Everything runs in a virtual environment in this checkout, made once by the first target that needs it.
PYTHON ?= $(shell for p in python3.11 python3.12 python3.13 python3; do \
	command -v $$p >/dev/null 2>&1 && $$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/ready
DOCS_READY := $(VENV)/docs-ready
BENCH_READY := $(VENV)/bench-ready
DIST_READY := $(VENV)/dist-ready


# What `make all` makes; a new result is one more word here and a section in results/README.md.
RESULTS := tables fig3 fig4 fig5 fig6 modulus inference support blades thermal stability tradeoff optimise validation cavity

# Python keeps what it compiles, whatever the shell says: tests and commands start in half the time.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help all $(RESULTS) test test-kernels test-oldest test-pythons lint docs reference tutorial face bench golden loops mutations dist clean

help:            ## show the targets
	@grep -E '^[a-z0-9-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*## */\t/' | expand -t 14

$(READY): pyproject.toml
	@test -n "$(PYTHON)" || { echo "Python 3.11 or newer is needed: install it, or make PYTHON=/path/to/python"; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[test]'
	@touch $@

$(DOCS_READY): $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	@touch $@

$(BENCH_READY): $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[bench]'
	@touch $@

$(DIST_READY): $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dist]'
	@touch $@

all: $(RESULTS)  ## every table, figure and chart, into results/

tables: $(READY) ## Tables I and II of the paper, into results/
	$(BIN)/python -m tools.tables

fig3: $(READY)   ## Figure 3: tilt against the separation of the wires in x
	$(BIN)/python -m tools.figure3

fig4: $(READY)   ## Figure 4: rotation against their upper separation in y
	$(BIN)/python -m tools.figure4

fig5: $(READY)   ## Figure 5: the triple's longitudinal transfer function
	$(BIN)/python -m tools.figure5

fig6: $(READY)   ## Figure 6: cross-coupling of the fused-silica stage
	$(BIN)/python -m tools.figure6

blades: $(READY) ## what taking blades in series with angled wires costs
	$(BIN)/python -m tools.blades

support: $(READY) ## what a support that gives way does to Table I
	$(BIN)/python -m tools.support

thermal: $(READY) ## thermal noise of a triple with a fused-silica final stage
	$(BIN)/python -m tools.thermal

stability: $(READY) ## where methods fail, and that ours does not
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tools.atlas

tradeoff: $(READY) ## speed against accuracy of models, methods, maps and random builds (six minutes)
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tools.tradeoff

modulus: $(READY) ## Young's modulus from the measured frequencies of Table I
	$(BIN)/python -m tools.youngs_modulus

validation: $(READY) ## suspensions that were built, held against numbers of others
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tools.validation

cavity: $(READY) ## optical spring of an arm between two quadruples, by pendsus and by finesse
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[finesse]'
	$(BIN)/python -m tools.cavity

optimise: $(READY) ## from vertical wires to a triple all of whose modes can be damped
	$(BIN)/python -m tools.optimise

face: $(READY)   ## the picture at the top of README.md
	$(BIN)/python -m tools.face

simulated: $(READY) ## simulated measurements of imperfect triples (measured/triple/, measured/diagnosis/)
	$(BIN)/python -m tools.simulated

inference: $(READY) ## what the paper does not print of Tables I and II
	$(BIN)/python -m tools.inference

test: $(READY)   ## run the tests
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n auto --dist loadfile

test-kernels: $(READY) ## run the tests under every kernel of OpenBLAS that this processor has, with one and two threads
	$(BIN)/python -m tools.kernels

test-oldest:     ## run the tests with the oldest versions of all libraries that pyproject.toml admits, in build/oldest
	@mkdir -p build
	$(PYTHON) tools/oldest.py > build/oldest.txt
	PIP_CONSTRAINT=build/oldest.txt $(MAKE) test VENV=build/oldest

test-pythons:    ## run the tests on Python 3.12 to 3.14, where these are to be had
	@for version in 3.12 3.13 3.14; do \
		if python$$version -c '' 2>/dev/null; then $(MAKE) test VENV=build/python$$version PYTHON=python$$version || exit 1; \
		else echo "python$$version: not on this machine"; fi; done

lint: $(READY)   ## style, types, layering
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/basedpyright
	$(BIN)/lint-imports

docs: $(DOCS_READY) ## the site, into site/, with every link checked
	rm -rf site
	$(BIN)/python -m sphinx -W --keep-going -q -n -d build/doctrees -c docs . site
	$(BIN)/python -m tools.links site

reference: $(READY) ## the tables of docs/ that the program itself knows: keys and options
	$(BIN)/python -m tools.reference

tutorial: $(READY) ## run the tutorials, and take in what they print and draw
	$(BIN)/python -m tools.tutorial

bench: $(BENCH_READY)  ## what things cost, as ratios to a floor measured in the same run
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m bench.run

golden: $(READY) ## regenerate tests/golden (say why in CHANGELOG.md, "Numbers changed")
	$(BIN)/python -m tests.support.golden

loops: $(READY) ## 512 loops with simple filters: no traceback, and the poles of characteristic equations (ten minutes)
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tools.loops

mutations: $(READY) ## damage 1,000 designs, data files, results, options and arguments (ten minutes)
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tools.mutations

dist: $(DIST_READY) ## the wheel and the source archive, into dist/, and the wheel tried in an empty environment
	$(BIN)/python -m tools.dist

clean:           ## remove the environment and caches
	rm -rf $(VENV) site .pytest_cache .ruff_cache .hypothesis build dist *.egg-info
