# One word per task. `make demo` and `make test` set up what they need by themselves.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

.PHONY: demo test lint format bench profiles loop-dlr clean

$(STAMP): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade pip
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[dev,cluster,classifier]'
	touch $@

demo: $(STAMP)
	@mkdir -p out/demo
	@$(BIN)/xosc-lateral template write cut-in -o out/demo
	@$(BIN)/xosc-lateral convert out/demo/cut-in.xosc -o out/demo/cut-in_lifelike.xosc --seed 1 --report out/demo/cut-in_report.html

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

test: lint
	$(BIN)/python -m pytest -n 2

format: $(STAMP)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

# The shipped driver profiles, rebuilt from the public recording (50 MB from PyPI): byte for byte what is in the tree.
WHEEL := out/data/tasi-0.15.4-py3-none-any.whl
profiles: $(STAMP) $(WHEEL)
	$(BIN)/python -m xosc_lateral.cli.build_library $(WHEEL) -o xosc_lateral/resources/driver_profiles --cards docs/profiles.md

# The loop over real motorway traffic: from the paper's model to what these drivers do; docs/closing_the_loop.md, section 6.
loop-dlr: $(STAMP) $(WHEEL)
	@mkdir -p out/loop-dlr
	$(BIN)/xosc-lateral import dlr-ht $(WHEEL) -o out/loop-dlr/drives.parquet
	$(BIN)/xosc-lateral fit out/loop-dlr/drives.parquet --model two-level -o out/loop-dlr/base.json
	$(BIN)/xosc-lateral close-loop out/loop-dlr/drives.parquet --profile out/loop-dlr/base.json -o out/loop-dlr/refined.json --report out/loop-dlr --seed 1

$(WHEEL): | $(STAMP)
	$(BIN)/python -m pip download --quiet --disable-pip-version-check --no-deps --dest $(@D) tasi==0.15.4

clean:
	rm -rf $(VENV) out build dist
