# Two commands do everything on a fresh machine: make demo, make test.
# The environment lives in .venv; `make clean` removes it and all that was built.

VENV := .venv
BIN := $(VENV)/bin
PYTHON ?= $(shell for p in python3 python3.13 python3.12 python3.11; do \
	$$p -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' 2>/dev/null \
	&& echo $$p && break; done)

# Side by side, processes with several threads each for linear algebra only wait for each other.
export OPENBLAS_NUM_THREADS ?= 1
# Without compiled modules each of the hundreds of processes of the tests compiles them anew: 0.5 s.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help demo demo-feedforward test test-nodes test-others test-slow fuzz reproduce feedforward localisation score adoption benchmark \
	naming reference reliability reliability-full experiments decisions mutants workbench docs lint clean

help:
	@echo 'make demo       install into $(VENV); a hidden effect is found, added, and the error falls'
	@echo 'make demo-feedforward   the nodes over topics: forces and a picture'
	@echo 'make test       install into $(VENV), run every test, ruff and mypy'
	@echo 'make test-nodes, test-others   the two halves of it, which run side by side'
	@echo 'make test-slow  the slow tests, which run before a release'
	@echo 'make fuzz       the tests of properties with new examples (10 minutes)'
	@echo 'make docs       the documentation as a site, into build/docs/html'
	@echo 'make reproduce  the figures and claims of the paper, into output/'
	@echo 'make feedforward   the table and picture of docs/feedforward.md (15 minutes)'
	@echo 'make localisation  how often compare is right about where the model fails (hours; it can be stopped)'
	@echo 'make score      how often diagnose is right about hidden effects (hours; it can be stopped)'
	@echo 'make adoption   error of the model after diagnose and adopt (hours; it can be stopped)'
	@echo 'make benchmark  speed against Pinocchio and MuJoCo, latency against an echo node'
	@echo 'make reliability   fuzz, soak, parameter storms and restarts of the node (15 minutes)'
	@echo 'make reliability-full   the same at full size (an hour or two)'
	@echo 'make naming     the naming benchmark: this package and its peers (an hour; NAMING=small: minutes)'
	@echo 'make reference  the smallest change since a reference run that is reported (an hour)'
	@echo 'make experiments   how often a designed motion decides an ambiguous verdict (hours; it can be stopped)'
	@echo 'make decisions  the score with each chosen number of the diagnosis halved and doubled (an hour)'
	@echo 'make mutants    which planted mistakes the tests notice (an hour)'
	@echo 'make workbench   how fast the workbench answers, in a real browser (5 minutes)'
	@echo 'make clean      remove $(VENV) and everything that was built'

demo: $(VENV)/.demo
	@$(BIN)/python demo/diagnosis_demo.py output

demo-feedforward: $(VENV)/.demo
	@$(BIN)/python demo/feedforward_demo.py output

# A test that hangs ends after this many seconds, with the stacks of all threads. The slowest are
# listed, and build/ gets the time of every test.
LIMIT := --timeout 300 --durations 40

# Nodes run in real time and mostly wait: they have the processor when they want it, and all else
# calculates meanwhile, in files by name, the dear ones of `app` and `inference` first.
# PYTEST has more options for both.
test: $(VENV)/.test
	$(MAKE) --jobs 3 --output-sync=target lint test-nodes test-others

test-nodes: $(VENV)/.test
	$(BIN)/python -m pytest $$(grep -rl 'mark\.nodes' test --include 'test_*.py') -n 2 \
	    --dist loadfile -m 'nodes and not slow' $(LIMIT) --junitxml build/test-nodes.xml $(PYTEST)

test-others: $(VENV)/.test
	nice -n 10 $(BIN)/python -m pytest test -n 2 --dist loadfile --no-loadscope-reorder \
	    -m 'not nodes and not slow' --file-budget 20 $(LIMIT) \
	    --junitxml build/test-others.xml $(PYTEST)

# What runs before a release: the site, colcon, demonstrations, clusters, long diagnoses, pictures.
test-slow: $(VENV)/.test $(VENV)/.docs
	$(BIN)/python -m pytest test -n 2 --dist loadfile -m slow --timeout 1800 $(PYTEST)
	$(MAKE) naming NAMING=small

# Property tests with examples that no run has seen.
fuzz: $(VENV)/.test
	$(BIN)/python -m pytest -n 2 -m 'not nodes' --hypothesis-profile new \
	    $$(grep -rl '^from hypothesis' test --include 'test_*.py')

lint: $(VENV)/.test
	$(BIN)/ruff check .
	$(BIN)/python docs/prose.py
	nice -n 10 $(BIN)/mypy

# -W: a warning is an error; all of them are shown first.
docs: $(VENV)/.docs
	$(BIN)/sphinx-build -W --keep-going -q -b html -d build/docs/doctrees docs build/docs/html
	@echo 'build/docs/html/index.html'

reproduce: $(VENV)/.demo
	$(BIN)/pprs reproduce --output output

feedforward: $(VENV)/.demo
	$(BIN)/python docs/feedforward.py

localisation: $(VENV)/.test
	$(BIN)/python -m benchmarks.scores.localisation 100

score: $(VENV)/.test
	$(BIN)/python -m benchmarks.scores.diagnosis --table benchmarks/results/diagnosis.md

adoption: $(VENV)/.test
	$(BIN)/python -m benchmarks.scores.adoption 24

reference: $(VENV)/.test
	$(BIN)/python -m benchmarks.scores.reference
	$(BIN)/python -m benchmarks.scores.reference --path 1
	$(BIN)/python -m benchmarks.scores.reference_robots --model config/hexapod.yaml --effects 30 --both 10
	$(BIN)/python -m benchmarks.scores.reference_robots --model config/delta.yaml --effects 30 --both 10

benchmark: $(VENV)/.test
	$(BIN)/python -m benchmarks.speed.model
	$(BIN)/python -m benchmarks.node.latency 10

reliability: $(VENV)/.test
	$(BIN)/python -m benchmarks.node.reliability

reliability-full: $(VENV)/.test
	$(BIN)/python -m benchmarks.node.reliability --full

# Public problems; tables and picture of benchmarks/results/naming.md. What is there is not run again.
NAMING ?= full
NAMING_PROBLEMS := $(if $(filter small,$(NAMING)),12,72)
NAMING_FOLDER := output/naming$(if $(filter small,$(NAMING)),-small)
NAMING_PAGE := $(if $(filter small,$(NAMING)),$(NAMING_FOLDER)/benchmark.md,benchmarks/results/naming.md)
naming: $(VENV)/.naming
	$(BIN)/python -m benchmarks.naming.run make $(NAMING_FOLDER) --seed 2 --problems $(NAMING_PROBLEMS)
	$(BIN)/python -m benchmarks.naming.run enter $(NAMING_FOLDER) $(if $(filter small,$(NAMING)),--whole)
	$(BIN)/python -m benchmarks.naming.real $(NAMING_FOLDER)/real
	$(BIN)/python -m benchmarks.naming.run enter $(NAMING_FOLDER)/real --whole
	$(BIN)/python -m benchmarks.naming.run score $(NAMING_FOLDER) --real $(NAMING_FOLDER)/real --page $(NAMING_PAGE)

experiments: $(VENV)/.test
	$(BIN)/python -m benchmarks.scores.experiments

decisions: $(VENV)/.test
	$(BIN)/python -m benchmarks.scores.decisions

mutants: $(VENV)/.test
	$(BIN)/python -m benchmarks.mutants

workbench: $(VENV)/.test
	$(BIN)/python -m benchmarks.speed.workbench 30 docs/images/workbench.png

# What the demonstration needs; the tests add to it.
$(VENV)/.demo: setup.py | $(VENV)/bin/python
	@echo 'Installing the package with ROS 2 wheels and compiling its equations (about a minute) ...'
	@$(BIN)/pip install -qq --upgrade pip
	@$(BIN)/pip install -qq --editable '.[ros,report,sim,bags,workbench]'
	@$(BIN)/python -m pprs_dynamics.physics.model.preparation
	@touch $@

$(VENV)/.test: $(VENV)/.demo
	@echo 'Installing physics engines, linters and colcon for the tests ...'
	@$(BIN)/pip install -qq --editable '.[ros,report,sim,bags,workbench,fleet,test]'
	@touch $@

$(VENV)/.naming: $(VENV)/.test
	@echo 'Installing the peers of the naming benchmark ...'
	@$(BIN)/pip install -qq --editable '.[ros,report,sim,bags,workbench,fleet,test,naming]'
	@touch $@

$(VENV)/.docs: $(VENV)/.demo
	@echo 'Installing Sphinx for the documentation ...'
	@$(BIN)/pip install -qq --editable '.[ros,report,sim,bags,workbench,fleet,docs]'
	@touch $@

$(VENV)/bin/python:
	@test -n '$(PYTHON)' || { echo 'pprs_dynamics needs Python 3.11, 3.12 or 3.13: none was found on PATH (or set PYTHON=...)' >&2; exit 1; }
	@$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); echo 'python -m venv failed; on Debian and Ubuntu: apt install python3-venv' >&2; exit 1; }

clean:
	rm -rf $(VENV) output build install log docs/generated *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
