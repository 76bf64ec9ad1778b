# Two commands do everything: `make train` and `make test`. Each sets up .venv first, when that is needed.
PYTHON ?= python3
ARGS ?=
BIN := .venv/bin

.PHONY: train drives test verify bench check clean

train: .venv/installed
	$(BIN)/python -m train.ppo $(ARGS)

drives: .venv/installed
	$(BIN)/python -m train.drives $(ARGS)

verify: .venv/installed
	$(BIN)/python -m train.verify $(ARGS)

test: .venv/installed-test
	$(BIN)/python -m pytest $(ARGS)

check: .venv/installed-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: .venv/installed-test .venv-peers/installed
	$(BIN)/python -m benchmarks $(ARGS)
	$(BIN)/python -m benchmarks.rfem
	$(BIN)/python -m benchmarks.rfem_peer --peer-python .venv-peers/bin/python

.venv/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "Python 3.11 or later is needed; $(PYTHON) is $$($(PYTHON) --version). Set PYTHON=..."; exit 1; }
	$(PYTHON) -m venv .venv

.venv/installed: pyproject.toml constraints.txt | .venv/bin/python
	$(BIN)/python -m pip install --disable-pip-version-check -q -c constraints.txt -e .
	touch $@

.venv/installed-test: .venv/installed
	$(BIN)/python -m pip install --disable-pip-version-check -q -c constraints.txt -e '.[test]'
	touch $@

.venv-peers/installed: benchmarks/peers.txt | .venv/bin/python
	$(PYTHON) -m venv .venv-peers
	.venv-peers/bin/python benchmarks/peers/install.py benchmarks/peers.txt
	touch $@

clean:
	rm -rf .venv .venv-peers build *.egg-info
