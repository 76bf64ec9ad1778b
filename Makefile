# Two commands do everything: `make train` and `make test`. Each sets up .venv first, when that is needed.
PYTHON ?= python3
ARGS ?=
BIN := .venv/bin

.DEFAULT_GOAL := help

.PHONY: help train demo docs drives test test-all verify results bench torture compat check clean

help:
	@echo "make train     learn to hold the load still and compare the agent (some five minutes)"
	@echo "make demo      watch a lift in the browser, live"
	@echo "make docs      build the documentation site, build/site/index.html"
	@echo "make test      run the suite but for what is marked slow (some ten minutes on two cores)"
	@echo "make test-all  run all of it: whole trainings, kills, tutorials (some half an hour)"
	@echo "make check     lint, format, layers, types"
	@echo "make torture   kill trainings and studies, fill disks, and count what is lost (an hour or two)"
	@echo "make drives | verify | results | bench | compat | clean"

train: .venv/installed
	$(BIN)/python -m train.ppo $(ARGS)

demo: .venv/installed-demo
	$(BIN)/python -m train.demo $(ARGS)

docs: .venv/installed-docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet
	@echo "build/site/index.html"

drives: .venv/installed
	$(BIN)/python -m train.drives $(ARGS)

verify: .venv/installed
	$(BIN)/python -m train.verify $(ARGS)

# Agents, comparisons and studies as they are shipped: some hours.
results: .venv/installed-test
	$(BIN)/python -m train.ppo --seeds 5 --eval-scenarios 0 --overwrite --out results/agents/ppo
	$(BIN)/python -m train.ppo --observation sensors --seeds 5 --eval-scenarios 0 --overwrite --out results/agents/ppo-sensors
	$(BIN)/python -m train.ppo --action predictive --seeds 5 --eval-scenarios 0 --overwrite --out results/agents/predictive-ppo
	$(BIN)/python -m train.ppo --action predictive --observation sensors --seeds 5 --eval-scenarios 0 --overwrite --out results/agents/predictive-ppo-sensors
	$(BIN)/python -m train.sac --seeds 5 --eval-scenarios 0 --overwrite --out results/agents/sac
	$(BIN)/python -m train.sac --observation sensors --seeds 5 --eval-scenarios 0 --overwrite --out results/agents/sac-sensors
	$(BIN)/python -m train.ppo --action speed --timesteps 3000000 --selected-by 100 --seeds 5 --eval-scenarios 0 --overwrite --out results/agents/ppo-speed
	$(BIN)/python -m train.sac --action speed --selected-by 100 --seeds 5 --eval-scenarios 0 --overwrite --out results/agents/sac-speed
	$(BIN)/python -m train.tune_control --scenarios 200 --evaluations 24 --overwrite --out results/control
	$(BIN)/python -m train.drives --case paper --check rfem --overwrite --out results/drives-paper
	$(BIN)/python -m train.drive_map --overwrite --out results/drive-map
	$(BIN)/python -m train.optimisers --overwrite --out results/optimisers
	$(BIN)/python -m train.evaluate --scenarios 1000 --workers 2 --overwrite --out results/comparison
	$(BIN)/python -m train.evaluate --model rfem --privileged 0 --workers 2 --overwrite --out results/comparison-full-model \
		--policies predictive-ppo ppo sac ppo-speed sac-speed predictive-ppo-sensors ppo-sensors sac-sensors \
		"predictive control (state)" "predictive control" "feed-forward + feedback (state)" "feed-forward + feedback"
	for task in storm unknown preview mru; do \
		$(BIN)/python -m train.apg --task $$task --overwrite --out results/agents/apg-$$task/seed-0 || exit; done
	for task in storm unknown deeprope preview mru splash landing; do \
		$(BIN)/python -m train.ppo --task $$task --action predictive --observation sensors --timesteps 600000 --eval-scenarios 0 --overwrite --out results/agents/predictive-ppo-$$task/seed-0 || exit; done
	$(BIN)/python -m train.sac --task storm --observation sensors --winch --eval-scenarios 0 --overwrite --out results/agents/sac-storm/seed-0
	for task in unknown mru; do \
		$(BIN)/python -m train.sac --task $$task --observation sensors --eval-scenarios 0 --overwrite --out results/agents/sac-$$task/seed-0 || exit; done
	$(BIN)/python -m train.sac --task splash --observation sensors --horizon 60 --eval-scenarios 0 --overwrite --out results/agents/sac-splash/seed-0
	$(BIN)/python -m train.sac --task landing --observation sensors --winch --horizon 60 --eval-scenarios 0 --overwrite --out results/agents/sac-landing/seed-0
	$(BIN)/python -m train.apg --task deeprope --episodes 750 --labels 80000 --imitation-steps 1500 --updates 230 --look-every 25 --overwrite --out results/agents/apg-deeprope/seed-0
	$(BIN)/python -m train.apg --task storm --observation state --overwrite --out results/agents/apg-state-storm/seed-0
	$(BIN)/python -m train.benchmark --workers 1 --overwrite --out results/tasks
	$(BIN)/python -m train.scenes --out results/tasks
	$(BIN)/python -m train.sensitivity --overwrite --out results/sensitivity
	$(BIN)/python -m train.deep_water --overwrite --out results/deep-water
	$(BIN)/python -m train.verify
	$(BIN)/python -m train.verify --water --overwrite --folder results/verification/water

test: .venv/installed-test
	$(BIN)/python -m pytest -n 2 --dist loadfile -m "not slow" $(ARGS)

test-all: .venv/installed-test
	$(BIN)/python -m pytest -n 2 --dist loadfile $(ARGS)

check: .venv/installed-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports --no-logo
	$(BIN)/mypy

bench: .venv/installed-test .venv-peers/installed
	$(BIN)/python -m benchmarks $(ARGS)
	$(BIN)/python -m benchmarks.rfem
	$(BIN)/python -m benchmarks.rfem_peer --peer-python .venv-peers/bin/python

torture: .venv/installed-test
	$(BIN)/python -m benchmarks.torture $(ARGS)

# Other people's libraries on the wheel: up to half an hour on two busy cores, and 4 to 12 GB for the environments.
compat: .venv/installed-test .venv-compat/learners/installed .venv-compat/rllib/installed
	$(BIN)/python -m compat $(ARGS)

.venv/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "Python 3.11 or later is needed; $(PYTHON) is $$($(PYTHON) --version). Set PYTHON=..."; exit 1; }
	$(PYTHON) -m venv .venv

.venv/installed: pyproject.toml constraints.txt | .venv/bin/python
	$(BIN)/python -m pip install --disable-pip-version-check -q -c constraints.txt -e .
	touch $@

.venv/installed-demo: .venv/installed
	$(BIN)/python -m pip install --disable-pip-version-check -q -c constraints.txt -e '.[demo]'
	touch $@

.venv/installed-docs: .venv/installed
	$(BIN)/python -m pip install --disable-pip-version-check -q -c constraints.txt -e '.[docs]'
	touch $@

.venv/installed-test: .venv/installed
	$(BIN)/python -m pip install --disable-pip-version-check -q -c constraints.txt -e '.[test]'
	touch $@

.venv-peers/installed: benchmarks/peers.txt | .venv/bin/python
	$(PYTHON) -m venv .venv-peers
	.venv-peers/bin/python benchmarks/peers/install.py benchmarks/peers.txt
	touch $@

.venv-compat/%/installed: compat/%.txt
	$(PYTHON) -m venv .venv-compat/$*
	.venv-compat/$*/bin/python -m pip install --disable-pip-version-check -q --no-cache-dir -r $<
	touch $@

clean:
	rm -rf .venv .venv-compat .venv-peers build *.egg-info
