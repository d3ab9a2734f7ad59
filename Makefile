# Two commands do everything on a fresh machine: `make demo` and `make test`. Both set up what is missing or stale.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

.PHONY: demo test lint docs bench setup clean

demo: $(STAMP)
	$(BIN)/python -m fdslam.run +experiment=fd_ad_pc

# The files of tests are shared among so many processes; 0: one after another in this one, as a debugger wants it.
WORKERS ?= 2

test: $(STAMP)
	$(BIN)/python -m pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

docs: $(STAMP)
	$(BIN)/python -m sphinx -c docs -d outputs/docs/.doctrees -W --keep-going -n -q . outputs/docs

bench: $(STAMP)
	$(BIN)/python -m experiments.speed.stages
	$(BIN)/python -m experiments.speed.localization --small
	$(BIN)/python -m experiments.speed.bing

setup: $(STAMP)

# Stale after a change of the dependencies: the stamp is older than the files that name them.
$(STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; v = sys.version_info[:2]; sys.exit(None if (3, 11) <= v < (3, 14) else "fdslam needs Python 3.11 to 3.13, %s is %d.%d: make PYTHON=python3.11" % (sys.executable, *v))'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	@touch $@

clean:
	rm -rf $(VENV) outputs
