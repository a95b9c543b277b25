# One word per task. `make demo` and `make test` set up what they need by themselves.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
DEV_STAMP := $(VENV)/.installed-dev
DOCS_STAMP := $(VENV)/.installed-docs

.PHONY: names pages laboratory find mutants fuzz lock install-locked sbom reproducible licences test-matrix demo test fast style lint format docs schema profiles templates loop-dlr picture map clean

# Python compiles what it imports when it does: a fifth of what is installed. What is installed is not listed.
QUICK := --disable-pip-version-check --quiet --progress-bar on --no-compile

# What running needs, and no more.
$(STAMP): pyproject.toml
	@echo "Setting up $(VENV): numpy, scipy, pandas, pyarrow, numba ... (a minute or two, 0.8 GB)"
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --disable-pip-version-check --quiet --upgrade pip
	@$(BIN)/python -m pip install $(QUICK) -e .
	@touch $@

# And what checking needs: linters, types, tests, every extra.
$(DEV_STAMP): pyproject.toml | $(STAMP)
	@echo "Setting up what the tests need: ruff, mypy, pytest, dask, scikit-learn, asammdf ... (another minute or two)"
	@$(BIN)/python -m pip install $(QUICK) -e '.[dev,mdf,cluster,classifier,osi,sumo,pictures]'
	@touch $@

# And what building the documentation needs.
$(DOCS_STAMP): pyproject.toml | $(STAMP)
	@$(BIN)/python -m pip install $(QUICK) -e '.[docs]'
	@touch $@

demo: $(STAMP)
	@mkdir -p out/demo
	@$(BIN)/xosc-lateral template write cut-in -o out/demo --force
	@$(BIN)/xosc-lateral convert out/demo/cut-in.xosc -o out/demo/cut-in_lifelike.xosc --seed 1 --report out/demo/cut-in_report.html
	@echo
	@echo "Look at the report:     out/demo/cut-in_report.html (in a browser)"
	@echo "Play it in a browser:   xosc-lateral view out/demo/cut-in_lifelike.xosc"
	@echo "Play it in esmini:      esmini --window 60 60 1000 500 --osc out/demo/cut-in_lifelike.xosc"
	@echo "Use the command line:   source $(BIN)/activate && xosc-lateral --help"

style: $(DEV_STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports --no-logo

# Tests of names, pages and links; `tests/test_names.py` keeps the list of their files.
LINT := $(addprefix tests/,test_names.py test_layers.py test_examples.py docs/test_pages.py docs/test_options.py world/player/test_documented.py)
names: $(DEV_STAMP)
	$(BIN)/python -m pytest -q -m lint $(LINT)

lint: style names
	$(BIN)/mypy

# All that `make lint` does: mypy runs as one of the tests (tests/test_front_door.py), beside the others.
test: style names
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist worksteal -m 'not lint and not pages'

# At length: loops from end to end, kills, other processors, recipes followed; what README, pages, examples and helps
# print; the site; the machines that look for faults, on fixed seeds.
pages: $(DEV_STAMP) $(DOCS_STAMP)
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist worksteal -m pages tests $(wildcard laboratory/tests/test_find_*.py)

# Under a minute, in one process: everything but what fits, converts, plays, imports or mutates for long.
FAST := $(addprefix tests/,world/road world/scenario world/motion world/surroundings drivers/drives files test_layers.py)
fast: $(DEV_STAMP)
	$(BIN)/python -m pytest -q $(FAST) -m 'not slow' -k 'not importers and not fuzz and not corpus'

# What proves the documentation's claims: its scripts start, their parts are right. Not part of `make test`.
laboratory: $(DEV_STAMP)
	$(BIN)/python -m pip install $(QUICK) -e '.[board]'
	$(BIN)/python -m pytest -n 2 --dist worksteal laboratory/tests

# Scenarios, recordings and drivers from a new seed (or SEED), judged and shrunk: what nobody thought of. A table of
# kinds, told or silent, with the smallest input of each, lands in out/find. esmini's library: ESMINI_LIBRARY.
find: $(DEV_STAMP)
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m laboratory.find out/find --minutes $(or $(MINUTES),20) $(if $(SEED),--seed $(SEED))

# Mutants of every input format against its reader: bytes damaged, then well-formed files that say something else;
# twenty minutes or so. What hurts lands in out/faults.
fuzz: $(DEV_STAMP)
	for how in bytes structure doors; do $(BIN)/python -m tests.faults --how $$how --count 300 --seed $(or $(SEED),1) || exit 1; done

format: $(DEV_STAMP)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

# A seeded sample of small changes to our own code, and the share that the tests of their room notice; an hour.
mutants: $(DEV_STAMP)
	$(BIN)/python -m pip install $(QUICK) 'cosmic-ray>=8.7,<9' 'coverage>=7' 'pytest-cov>=7'
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 nice $(BIN)/python -m laboratory.mutants --count 200 --seed $(or $(SEED),1)

# The documentation site, into out/site: references from the code, pages from docs/. A warning is an error.
docs: $(DOCS_STAMP)
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet
	@echo "Open out/site/index.html; its search needs a server: python3 -m http.server -d out/site"

# JSON Schema of profile files, from the types.
schema: $(STAMP)
	$(BIN)/python -m tests.kit.schema

# The shipped driver profiles, rebuilt from the public recording (50 MB from PyPI), byte for byte.
WHEEL := out/data/tasi-0.15.4-py3-none-any.whl
# GNSS: the files of OpenACC's AstaZero campaign, from its catalogue (docs/real_data.md).
GNSS ?= ASta_040719_platoon3.csv ASta_050719_platoon1.csv

profiles: $(STAMP) $(WHEEL)
	$(BIN)/python -m laboratory.build_library $(WHEEL) $(GNSS:%=--gnss %) -o driver_profiles

# The README's picture, and CONTRIBUTING's map of the imports.
picture: $(STAMP)
	$(BIN)/python docs/figures/lifelike.py
	$(BIN)/python docs/figures/osi.py

map: $(DEV_STAMP)
	PYTHONPATH=. $(BIN)/python docs/figures/map.py

# The shipped templates as plain files: what their builders make of the defaults.
templates: $(STAMP)
	for name in $$(ls templates/*.xosc | xargs -n 1 basename -s .xosc); do $(BIN)/xosc-lateral template write $$name -o templates; done

# The loop over real motorway traffic: from the paper's model to what these drivers do; docs/closing_the_loop.md.
loop-dlr: $(STAMP) $(WHEEL)
	@mkdir -p out/loop-dlr
	$(BIN)/xosc-lateral import dlr-ht $(WHEEL) -o out/loop-dlr/drives.parquet
	$(BIN)/xosc-lateral fit out/loop-dlr/drives.parquet --model two-level -o out/loop-dlr/base.json
	$(BIN)/xosc-lateral close-loop out/loop-dlr/drives.parquet --profile out/loop-dlr/base.json -o out/loop-dlr/refined.json --report out/loop-dlr --seed 20241007

$(WHEEL): | $(STAMP)
	$(BIN)/python -m pip download --quiet --disable-pip-version-check --no-deps --dest $(@D) tasi==0.15.4

# Every package that development and CI install, with hashes; see SECURITY.md. All extras but `commonroad`, whose protobuf
# is not the one of `osi`.
LOCK := requirements/lock.txt
EXTRAS := mdf osi cluster classifier board sumo pictures docs dev
UV ?= $(BIN)/uv
MATRIX ?= 3.11 3.12 3.13

lock: $(DEV_STAMP)
	$(UV) pip compile pyproject.toml $(addprefix --extra ,$(EXTRAS)) --generate-hashes --python-version 3.11 --universal --quiet \
		--custom-compile-command 'make lock' -o $(LOCK)

install-locked:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r $(LOCK)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps -e .

sbom: $(DEV_STAMP)
	@mkdir -p out
	$(UV) tool run --from 'cyclonedx-bom>=7,<8' cyclonedx-py requirements $(LOCK) --pyproject pyproject.toml \
		--output-reproducible -o out/sbom.json

# Wheel and source distribution twice, from two clones: the same bytes.
reproducible: $(DEV_STAMP)
	rm -rf out/twice && mkdir -p out/twice
	for one in a b; do \
		git clone -q . out/twice/$$one && $(UV) build -q --out-dir out/twice/dist-$$one out/twice/$$one || exit 1; \
	done
	diff -r out/twice/dist-a out/twice/dist-b && sha256sum out/twice/dist-a/*

licences: $(DEV_STAMP)
	$(UV) tool run --from 'pip-licenses>=5,<6' pip-licenses --python $(BIN)/python --order=license

# Takes an hour: every Python, then the lower bounds of all dependencies. TESTS= chooses a part.
test-matrix: $(DEV_STAMP)
	for python in $(MATRIX); do \
		$(UV) venv --quiet --clear --python $$python out/matrix/$$python && \
		$(UV) pip install --quiet --python out/matrix/$$python/bin/python -e '.[dev,cluster,classifier,mdf,osi]' && \
		out/matrix/$$python/bin/python -m pytest -q $(TESTS) || exit 1; \
	done
	$(UV) venv --quiet --clear --python 3.11 out/matrix/lowest
	$(UV) pip install --quiet --python out/matrix/lowest/bin/python --resolution lowest-direct -e '.[dev]'
	out/matrix/lowest/bin/python -m pytest -q $(TESTS)

clean:
	rm -rf $(VENV) out build dist
