# One-word targets; `make help` lists them. CAPTURE=, RUN=, PRESET=, BUDGET=, MINUTES=, SEED=, ENGINE= go to the command line.
# Without RUN= a capture's run folder bears its name, so that CAPTURE= alone leads every stage to it. POLICY= names one
# that ships; with it CAPTURE= is the recording that it learnt from, which only some ask for.

PYTHON ?= python3.11
RUN ?= runs/$(if $(POLICY),policy-$(POLICY),$(if $(CAPTURE),$(basename $(notdir $(CAPTURE))),default))

export PIP_DISABLE_PIP_VERSION_CHECK := 1
VENV := .venv
BIN := $(VENV)/bin
KINEMIMIC = $(BIN)/kinemimic
SHIPPED = $(if $(POLICY),--policy "$(POLICY)" $(if $(CAPTURE),--capture "$(CAPTURE)"))
TRAINING = $(if $(PRESET),--preset "$(PRESET)") $(if $(BUDGET),--budget "$(BUDGET)") $(if $(MINUTES),--minutes "$(MINUTES)") $(if $(SEED),--seed "$(SEED)") $(if $(ENGINE),--engine "$(ENGINE)")

# An editable install in strict mode links the package's files one by one: a new or a removed file asks for a
# new install, an edited one does not. So the stamp bears a digest of the list of files in its name.
FILES := $(sort $(shell find pipeline retarget train evaluate datasets -type f -not -path '*/__pycache__/*' -not -path 'train/native/*' -not -path 'datasets/versions/*'))
STAMP := $(VENV)/installed-$(firstword $(shell echo '$(FILES)' | cksum))

# The fast engine: compiled from Bullet's sources, BULLET=fetched (by name, version and hash) or BULLET=system (an
# installed one). Unsaid, it is the one that was built last.
BULLET := $(or $(BULLET),$(patsubst $(VENV)/native-%,%,$(firstword $(wildcard $(VENV)/native-*))),fetched)
NATIVE := $(VENV)/native-$(BULLET)
NATIVE_FILES := $(wildcard $(addprefix train/native/,*.cpp *.hpp *.py pyproject.toml stubs/*/*.pyi))

.PHONY: help setup formats inspect run ingest convert retarget train evaluate pushes disturb gait view export policies reproduce compare study comparison overlay data data-check data-push data-pull test test-slow lint type format docs architecture docs-test mutants bench bench-clean profile wheel install-test clean
.DEFAULT_GOAL := help

help: ## This list
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 12

setup: $(STAMP) $(NATIVE) ## Build .venv; nothing to do when nothing changed

# torch goes first and alone: its index is the one thing that differs between machines (README).
$(STAMP): pyproject.toml constraints.txt
	$(if $(shell $(PYTHON) -c 'import sys; print(sys.version_info[:2] == (3, 11) or "")' 2>&1 | grep True),,\
	  $(error kinemimic needs Python 3.11 with its venv module, and $(PYTHON) is none: install it, or name one with PYTHON=))
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet -c constraints.txt torch==2.13.0 setuptools
	$(BIN)/python -m pip install --quiet -c constraints.txt --no-build-isolation --config-settings editable_mode=strict -e '.[dev]'
	@rm -f $(VENV)/installed-*
	@touch $@

# Where it cannot be built one line says why, no stamp is made, and the next `make setup` tries again.
$(NATIVE): $(NATIVE_FILES) constraints.txt | $(STAMP)
	@rm -f $(VENV)/native-*
	$(BIN)/python train/native/install.py $(BULLET) $@

# What builds the pages is asked for by `make docs` alone.
$(VENV)/docs-installed: pyproject.toml constraints.txt | $(STAMP)
	$(BIN)/python -m pip install --quiet -c constraints.txt --no-build-isolation --config-settings editable_mode=strict -e '.[docs]'
	@touch $@

run: setup ## Every stage on CAPTURE= (without one, the embedded virtual Kinect) into RUN=
	$(KINEMIMIC) run $(if $(CAPTURE),"$(CAPTURE)") --run "$(RUN)" $(TRAINING)

formats: setup ## The capture formats that can be read
	$(KINEMIMIC) formats

inspect: setup ## What CAPTURE= is, a file or a folder, and how good it is
	$(KINEMIMIC) inspect "$(CAPTURE)"

ingest: setup ## CAPTURE= into RUN=: passes, gaps, filter, quality report
	$(KINEMIMIC) ingest $(if $(CAPTURE),"$(CAPTURE)") --run "$(RUN)"

convert: setup ## Euler angles or positions to quaternions
	$(KINEMIMIC) convert --run "$(RUN)"

retarget: setup ## Onto the 20 nodes and the body; JSON and MCAP
	$(KINEMIMIC) retarget --run "$(RUN)"

train: setup ## A policy that imitates the motion (PRESET= BUDGET= MINUTES= SEED= ENGINE= SCENARIO=)
	$(KINEMIMIC) train --run "$(RUN)" $(TRAINING) $(if $(SCENARIO),--scenario "$(SCENARIO)")

evaluate: setup ## Scores, report, curves (POLICY=walk: of one that ships)
	$(KINEMIMIC) evaluate --run "$(RUN)" $(SHIPPED) $(if $(ENGINE),--engine "$(ENGINE)")

pushes: setup ## How hard a push the policy survives, from each side (POLICY=walk: of one that ships)
	$(KINEMIMIC) pushes --run "$(RUN)" $(SHIPPED) $(if $(ENGINE),--engine "$(ENGINE)")

disturb: setup ## Forces, torques, obstacles, other ground: SCENARIO= by name or file, TRIALS= (POLICY=walk: of one that ships)
	$(KINEMIMIC) disturb $(SCENARIO) --run "$(RUN)" $(SHIPPED) $(if $(TRIALS),--trials "$(TRIALS)") $(if $(ENGINE),--engine "$(ENGINE)")

gait: setup ## Cadence, stride, symmetry and curves of RUN= over what is normal
	$(KINEMIMIC) gait --run "$(RUN)"

view: setup ## The rerun recording (POLICY=walk: of one that ships)
	$(KINEMIMIC) view --run "$(RUN)" $(SHIPPED)

export: setup ## Capture, reference, simulated motion, policy into RUN=/export: BVH, TRC, CSV, npz, ONNX …
	$(KINEMIMIC) export --run "$(RUN)" $(SHIPPED)

policies: setup ## Those that ship, and how well they do
	$(KINEMIMIC) policies

reproduce: setup ## Train the policies that ship, or POLICY= alone (hours; KINEMIMIC_CAPTURES= holds the recordings)
	$(KINEMIMIC) reproduce $(if $(POLICY),--only "$(POLICY)") $(if $(ENGINE),--engine "$(ENGINE)")

compare: setup ## Tasks RUNS= (or RUN=; RUN@SCENARIO) trained and scored: medians over SEEDS= (PRESET= ABLATION=1 SEARCH= BUDGETS= ENGINE=)
	$(KINEMIMIC) compare $(or $(RUNS),"$(RUN)") $(if $(PRESET),--preset "$(PRESET)") $(if $(ABLATION),--ablation) $(if $(SEARCH),--search "$(SEARCH)") $(if $(SEEDS),--seeds "$(SEEDS)") $(if $(BUDGETS),--budgets "$(BUDGETS)") $(if $(ENGINE),--engine "$(ENGINE)")

study: setup ## The paper's experiments on what `make comparison` trained: runs/study/study.html (TRIALS= ENGINE=)
	$(KINEMIMIC) study $(if $(TRIALS),--trials "$(TRIALS)") $(if $(ENGINE),--engine "$(ENGINE)")

# Ours, DDPG, actor-critic and stable-baselines3's PPO on the paper's three tasks, with the same small nets.
comparison: setup ## Train what `study` compares (hours), into datasets/comparison (ENGINE=)
	$(KINEMIMIC) compare datasets/policies/walk datasets/policies/run datasets/policies/walk@several-obstacles \
	  --preset default --preset ddpg --preset a2c --preset sb3-ppo --seeds 3 --budgets 3e5,1e6 --limit ddpg=3e5 --limit sb3-ppo=3e5 --hidden 128,64 \
	  --out runs/comparison --publish datasets/comparison $(if $(ENGINE),--engine "$(ENGINE)")

overlay: setup ## The skeleton drawn into CAPTURE=, a depth recording's folder: RUN=/overlay.mp4
	$(KINEMIMIC) overlay "$(CAPTURE)" --out "$(RUN)/overlay.mp4"

# dvc brings a hundred packages that only who changes the data set needs.
DVC := $(VENV)/dvc-installed
$(DVC): constraints.txt | $(STAMP)
	$(BIN)/python -m pip install --quiet -c constraints.txt dvc
	@touch $@

data: setup $(DVC) ## Make the versioned data set anew and lock it (datasets/versions/params.toml)
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/dvc repro --force
	$(KINEMIMIC) datasets lock

data-check: setup ## Is the data set what is locked, and is it still made so? (AGAINST= a commit)
	$(KINEMIMIC) datasets check $(if $(AGAINST),--against "$(AGAINST)")

data-push: $(DVC) ## The data set's large files to the remote (runs/data-remote, unless dvc has another)
	$(BIN)/dvc push

data-pull: $(DVC) ## The data set's large files from the remote
	$(BIN)/dvc pull

# Small matrices on every core at once: more threads than one each only get in each other's way.
test: setup ## The tests that take seconds
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -m "not slow" -n 2

test-slow: setup ## The tests that take minutes
	$(BIN)/python -m pytest -m slow

lint: setup ## ruff, formatting, the direction of imports
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/lint-imports

type: setup ## mypy --strict
	$(BIN)/mypy

format: setup ## Let ruff rewrite the files
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

docs: setup $(VENV)/docs-installed ## The pages of docs/ as a site: open site/index.html
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

architecture: setup ## docs/architecture.svg: the rooms and the imports between them
	$(BIN)/python docs/draw_architecture.py

docs-test: setup $(VENV)/docs-installed ## What the pages print, done as their reader does it: minutes
	$(BIN)/python -m pytest -m slow tests/docs

MUTANTS := $(VENV)/mutants-installed
$(MUTANTS): constraints.txt | $(STAMP)
	$(BIN)/python -m pip install --quiet -c constraints.txt cosmic-ray
	@touch $@

mutants: setup $(MUTANTS) ## Mutations of the core that no test notices (ROOMS="train/ppo"; hours for all)
	$(BIN)/python tests/mutants.py $(ROOMS)

# The comparison of filters takes minutes, and answers another question than speed.
bench: setup ## Speed: every tests/bench/bench_*.py but the next
	@set -e; for script in $(sort $(filter-out %/bench_clean.py,$(wildcard tests/bench/bench_*.py))); do echo "$$script"; $(BIN)/python "$$script"; done

bench-clean: setup ## Every filter against the virtual Kinect's truth: which is the default
	$(BIN)/python tests/bench/bench_clean.py

profile: setup ## Where the native engine's time goes, as Linux's perf sees it
	$(BIN)/python tests/bench/profile_step.py

# By way of the sdist, which thereby is known to be complete.
wheel: setup ## dist/: kinemimic as sdist and wheel, in pure Python, and kinemimic-native for any x86-64
	rm -rf build/lib
	$(BIN)/python -m build --no-isolation --outdir dist .
	KINEMIMIC_BULLET="$$($(if $(filter system,$(BULLET)),echo system,$(BIN)/python train/native/fetch.py build))" KINEMIMIC_ARCH= \
	  $(BIN)/python -m build --wheel --no-isolation --outdir dist train/native

install-test: setup ## A wheel in an empty environment beside Hugging Face's packages runs the whole way
	$(BIN)/python -m pytest -m slow tests/test_wheel.py

# .venv goes with build/, which holds the links of the editable install. runs/ holds hours of training: it stays.
clean: ## Remove all that was built, but not runs/
	rm -rf $(VENV) build dist site *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
