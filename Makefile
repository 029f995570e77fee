# `make demo` and `make test` work in a fresh clone: each makes its own virtual environment, installs, and runs.

PYTHON ?= python3
VENV ?= .venv
INSTALLED = $(VENV)/.installed-by-make

.PHONY: demo test run-tests fuzz soak clean

demo: $(INSTALLED)
	$(VENV)/bin/naoimitate demo

test: $(INSTALLED) run-tests

run-tests:
	$(VENV)/bin/pytest -n auto

# The long tests, at full size: minutes to half an hour.
fuzz: $(INSTALLED)
	$(VENV)/bin/python benchmarks/fuzz.py

soak: $(INSTALLED)
	$(VENV)/bin/python benchmarks/soak.py

$(INSTALLED): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(VENV)/bin/python -m pip install --quiet --upgrade pip
	PYTHONWARNINGS=ignore $(VENV)/bin/python -m pip install --quiet --editable ".[test]"
	touch $@

clean:
	rm -rf $(VENV) build dist naoimitate.egg-info naoimitate-demo .ci/work
