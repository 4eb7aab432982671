# `make help` lists the targets. CAPTURE=, RUN=, PRESET=, FROM=, TEACHERS=, FROM_SCRATCH=, BUDGET=, MINUTES=, SEED=, ENGINE= are passed to the command
# line. Without RUN=, the run folder is named after the capture, so CAPTURE= alone selects it for every stage. POLICY= names a
# policy that ships; CAPTURE= is then the recording that it was trained on, which only some policies need. POLICY=tracker
# performs any capture.

PYTHON ?= python3.11
RUN ?= runs/$(if $(filter-out tracker,$(POLICY)),policy-$(POLICY),$(if $(CAPTURE),$(basename $(notdir $(CAPTURE))),default))

export PIP_DISABLE_PIP_VERSION_CHECK := 1
VENV := .venv
BIN := $(VENV)/bin
KINEMIMIC = $(BIN)/kinemimic
SHIPPED = $(if $(POLICY),--policy "$(POLICY)" $(if $(filter-out tracker,$(POLICY)),$(if $(CAPTURE),--capture "$(CAPTURE)")))
TRAINING = $(if $(PRESET),--preset "$(PRESET)") $(if $(FROM),--from "$(FROM)") $(if $(TEACHERS),--teachers "$(TEACHERS)") $(if $(BUDGET),--budget "$(BUDGET)") $(if $(MINUTES),--minutes "$(MINUTES)") $(if $(SEED),--seed "$(SEED)") $(if $(ENGINE),--engine "$(ENGINE)")

# An editable install in strict mode links the package's files one by one: added or removed files require a
# new install, edited files do not. The name of the stamp therefore has a digest of the list of files.
FILES := $(sort $(shell find api pipeline retarget train evaluate datasets -type f -not -path '*/__pycache__/*' -not -path 'train/native/*' -not -path 'datasets/versions/*'))
STAMP := $(VENV)/installed-$(firstword $(shell echo '$(FILES)' | cksum))

# The native engine is compiled from Bullet's sources: BULLET=fetched (by name, version and hash) or BULLET=system (an
# installed Bullet). The default is the one that was built last.
BULLET := $(or $(BULLET),$(patsubst $(VENV)/native-%,%,$(firstword $(wildcard $(VENV)/native-*))),fetched)
NATIVE := $(VENV)/native-$(BULLET)
NATIVE_FILES := $(wildcard $(addprefix train/native/,*.cpp *.hpp *.py pyproject.toml stubs/*/*.pyi))

.PHONY: help setup formats inspect run batch library tracker correct-tracker predictor ingest convert retarget train evaluate pushes disturb gait view simulate stream export policies reproduce compare study comparison overlay data data-check data-push data-pull test test-slow lint type format docs architecture docs-test mutants bench bench-batch bench-clean bench-ray bench-simulate bench-stream bench-stream-exercises bench-stream-noise bench-stream-page bench-truth hip-gap sensor-accuracy tracker-ablation video-accuracy profile wheel install-test clean
.DEFAULT_GOAL := help

help: ## Show this list
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 18

# $(call watched,WHAT,COMMAND): a line every 15 s while the command is silent, which pip and a compiler can be for
# minutes. The sleep must not hold the output open after the end.
watched = (while sleep 15 > /dev/null 2>&1; do echo "make: $(1) ..."; done) & beat=$$!; \
	trap 'kill $$beat 2> /dev/null' EXIT; trap 'kill $$beat; exit 130' INT TERM; $(2)

setup: $(STAMP) $(NATIVE) ## Build or update .venv, and the native engine

# torch is installed first and alone, from PyTorch's index of CPU builds where that answers: the builds for GPUs take
# 4.5 GB more, and only `--device cuda` of `compare` and `train-tracker` uses them. TORCH_INDEX= (empty) takes the
# index that pip is configured for.
TORCH_INDEX ?= https://download.pytorch.org/whl/cpu
TORCH := torch==2.13.0
$(STAMP): pyproject.toml constraints.txt
	$(if $(shell $(PYTHON) -c 'import sys; print((3, 11) <= sys.version_info < (3, 14) or "")' 2>&1 | grep True),,\
	  $(error kinemimic needs Python 3.11, 3.12 or 3.13 with its venv module, but $(PYTHON) is not one of these: install one, or select one with PYTHON=))
	$(PYTHON) -m venv $(VENV)
	@$(call watched,installing PyTorch,if [ -n "$(TORCH_INDEX)" ] && $(BIN)/python -c "import urllib.request as r; r.urlopen('$(TORCH_INDEX)/torch/', timeout=5)" 2>/dev/null \
	  && $(BIN)/python -m pip install --quiet -c constraints.txt --index-url "$(TORCH_INDEX)" $(TORCH); \
	then echo "torch: the CPU build of $(TORCH_INDEX)"; \
	else $(BIN)/python -m pip install --quiet -c constraints.txt $(TORCH) && echo "torch: from the index that pip is configured for"; fi)
	$(BIN)/python -m pip install --quiet -c constraints.txt setuptools
	@$(call watched,installing kinemimic and its packages,(set -x; $(BIN)/python -m pip install --quiet -c constraints.txt --no-build-isolation --config-settings editable_mode=strict -e '.[dev]'))
	@rm -f $(VENV)/installed-*
	@touch $@

# If the build fails, one line says why; without a stamp, the next `make setup` tries again.
$(NATIVE): $(NATIVE_FILES) constraints.txt | $(STAMP)
	@rm -f $(VENV)/native-*
	@$(call watched,compiling the native engine,(set -x; $(BIN)/python train/native/install.py $(BULLET) $@))

# Only `make docs` and `make docs-test` need the packages that build the pages.
$(VENV)/docs-installed: pyproject.toml constraints.txt | $(STAMP)
	@$(call watched,installing the packages of the documentation,(set -x; $(BIN)/python -m pip install --quiet -c constraints.txt --no-build-isolation --config-settings editable_mode=strict -e '.[docs]'))
	@touch $@

run: setup ## Run every stage on CAPTURE= (default: the virtual Kinect) into RUN=; POLICY=tracker: no training; FROM_SCRATCH=1: train from random weights
	$(KINEMIMIC) run $(if $(CAPTURE),"$(CAPTURE)") --run "$(RUN)" $(if $(POLICY),--policy "$(POLICY)") $(if $(FROM_SCRATCH),--from-scratch) $(TRAINING)

batch: setup ## Make motions from all captures in CAPTURE= below RUN=, with a table of the results
	$(KINEMIMIC) batch "$(CAPTURE)" --out "$(RUN)"

library: setup ## Collect the motions of all captures in CAPTURE= in a motion library at RUN=
	$(KINEMIMIC) library "$(CAPTURE)" --out "$(RUN)"

tracker: setup ## Train one policy for any motion on the library LIBRARY= into RUN= (hours; FROM= BUDGET= MINUTES= SEED= ENGINE= DEVICE=cuda)
	$(KINEMIMIC) train-tracker "$(LIBRARY)" --out "$(RUN)" $(TRAINING) $(if $(DEVICE),--device "$(DEVICE)")

correct-tracker: setup ## Correct a tracker's knees and hips on the library LIBRARY= into RUN= (minutes; FROM= SEED=)
	$(KINEMIMIC) correct-tracker "$(LIBRARY)" --out "$(RUN)" $(if $(FROM),--from "$(FROM)") $(if $(SEED),--seed $(SEED))

predictor: setup ## Learn from the library LIBRARY= how a motion goes on, and what is noise, into RUN= (minutes; SEED=)
	$(KINEMIMIC) train-predictor "$(LIBRARY)" --out "$(RUN)" $(if $(SEED),--seed $(SEED))

formats: setup ## List the capture formats that can be read
	$(KINEMIMIC) formats

inspect: setup ## Report on CAPTURE=, a file or a folder, and its quality
	$(KINEMIMIC) inspect "$(CAPTURE)"

ingest: setup ## Read CAPTURE= into RUN=: passes, gaps, filter, quality report
	$(KINEMIMIC) ingest $(if $(CAPTURE),"$(CAPTURE)") --run "$(RUN)"

convert: setup ## Convert Euler angles or positions to quaternions
	$(KINEMIMIC) convert --run "$(RUN)"

retarget: setup ## Fit the capture to the 20 nodes and the humanoid; JSON and MCAP
	$(KINEMIMIC) retarget --run "$(RUN)"

train: setup ## Train a policy that imitates the motion (PRESET= FROM=tracker TEACHERS= BUDGET= MINUTES= SEED= ENGINE= SCENARIO=)
	$(KINEMIMIC) train --run "$(RUN)" $(TRAINING) $(if $(SCENARIO),--scenario "$(SCENARIO)")

evaluate: setup ## Score the policy: report, curves (POLICY=walk for a shipped one)
	$(KINEMIMIC) evaluate --run "$(RUN)" $(SHIPPED) $(if $(ENGINE),--engine "$(ENGINE)")

pushes: setup ## Find the hardest push that the policy survives, from each side (POLICY=walk for a shipped one)
	$(KINEMIMIC) pushes --run "$(RUN)" $(SHIPPED) $(if $(ENGINE),--engine "$(ENGINE)")

disturb: setup ## Test with forces, torques, obstacles or different ground: SCENARIO= name or file, TRIALS= (POLICY=walk for a shipped one)
	$(KINEMIMIC) disturb $(SCENARIO) --run "$(RUN)" $(SHIPPED) $(if $(TRIALS),--trials "$(TRIALS)") $(if $(ENGINE),--engine "$(ENGINE)")

gait: setup ## Report cadence, stride, symmetry and curves of RUN= against bands of children and adults
	$(KINEMIMIC) gait --run "$(RUN)"

view: setup ## Write a rerun recording (POLICY=walk for a shipped policy)
	$(KINEMIMIC) view --run "$(RUN)" $(SHIPPED)

simulate: setup ## Push the humanoid on a page in the browser, in real time (POLICY=walk for a shipped policy)
	$(KINEMIMIC) simulate --run "$(RUN)" $(SHIPPED)

stream: setup ## Let a live capture drive the humanoid: CAPTURE= at its own clock, or frames over UDP
	$(KINEMIMIC) stream $(if $(CAPTURE),--replay "$(CAPTURE)")

export: setup ## Export capture, reference, simulated motion, policy into RUN=/export: BVH, TRC, CSV, npz, ONNX …
	$(KINEMIMIC) export --run "$(RUN)" $(SHIPPED)

policies: setup ## List the shipped policies, with their scores
	$(KINEMIMIC) policies

reproduce: setup ## Train the shipped policies again, or only POLICY= (hours; KINEMIMIC_CAPTURES= is the folder of the recordings)
	$(KINEMIMIC) reproduce $(if $(POLICY),--only "$(POLICY)") $(if $(ENGINE),--engine "$(ENGINE)")

compare: setup ## Train and score the tasks RUNS= (or RUN=; RUN@SCENARIO): medians over SEEDS= (PRESET= ABLATION=1 SEARCH= BUDGETS= ENGINE=)
	$(KINEMIMIC) compare $(or $(RUNS),"$(RUN)") $(if $(PRESET),--preset "$(PRESET)") $(if $(ABLATION),--ablation) $(if $(SEARCH),--search "$(SEARCH)") $(if $(SEEDS),--seeds "$(SEEDS)") $(if $(BUDGETS),--budgets "$(BUDGETS)") $(if $(ENGINE),--engine "$(ENGINE)")

study: setup ## Repeat the paper's experiments with the policies of `make comparison`: runs/study/study.html (TRIALS= ENGINE=)
	$(KINEMIMIC) study $(if $(TRIALS),--trials "$(TRIALS)") $(if $(ENGINE),--engine "$(ENGINE)")

# Our PPO and that of stable-baselines3, A2C, DDPG, TD3 and SAC, each with the layers with which it does best
# (docs/results-paper.md). A seed of the last three takes half an hour to two hours of one core.
COMPARED := --seeds 3 --budgets 3e5,1e6 --out runs/comparison --publish datasets/comparison
ALL_TASKS := datasets/policies/walk datasets/policies/run datasets/policies/walk@several-obstacles
comparison: setup ## Train the policies that `study` compares (hours), into datasets/comparison (ENGINE=)
	$(KINEMIMIC) compare $(ALL_TASKS) --preset ddpg --preset td3 --preset sac --hidden 512,256 $(COMPARED) $(if $(ENGINE),--engine "$(ENGINE)")
	$(KINEMIMIC) compare $(ALL_TASKS) --preset default --preset a2c --preset sb3-ppo --hidden 256,128 $(COMPARED) $(if $(ENGINE),--engine "$(ENGINE)")

overlay: setup ## Draw the skeleton into CAPTURE=, a video or a depth recording's folder: RUN=/overlay.webm
	$(KINEMIMIC) overlay "$(CAPTURE)" --out "$(RUN)/overlay.webm"

# dvc brings a hundred packages; only changes of the data set need them.
DVC := $(VENV)/dvc-installed
$(DVC): constraints.txt | $(STAMP)
	$(BIN)/python -m pip install --quiet -c constraints.txt dvc
	@touch $@

data: setup $(DVC) ## Rebuild the versioned data set and lock it (datasets/versions/params.toml)
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/dvc repro --force
	$(KINEMIMIC) datasets lock

data-check: setup ## Check that the data set matches its lock, and that a rebuild gives the same result (AGAINST= a commit)
	$(KINEMIMIC) datasets check $(if $(AGAINST),--against "$(AGAINST)")

data-push: $(DVC) ## Push the data set's large files to dvc's remote (default runs/data-remote)
	$(BIN)/dvc push

data-pull: $(DVC) ## Pull the data set's large files from dvc's remote
	$(BIN)/dvc pull

# Small matrices on all cores: more than one thread per process slows them down.
test: setup ## Run the tests that take seconds each
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -m "not slow" -n 2

test-slow: setup ## Run the tests that take minutes
	$(BIN)/python -m pytest -m slow

lint: setup ## Run ruff, and check the formatting and the direction of imports
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/lint-imports

type: setup ## Run mypy --strict
	$(BIN)/mypy

format: setup ## Reformat the code with ruff
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

docs: setup $(VENV)/docs-installed ## Build the pages of docs/ as a site: open site/index.html
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

architecture: setup ## Draw docs/architecture.svg: the packages and the imports between them
	$(BIN)/python docs/draw_architecture.py

docs-test: setup $(VENV)/docs-installed ## Run the commands on the pages and compare their output (minutes)
	$(BIN)/python -m pytest -m slow tests/docs

MUTANTS := $(VENV)/mutants-installed
$(MUTANTS): constraints.txt | $(STAMP)
	$(BIN)/python -m pip install --quiet -c constraints.txt cosmic-ray
	@touch $@

mutants: setup $(MUTANTS) ## Find mutations of the core that no test detects (PACKAGES="train/ppo"; hours for all)
	$(BIN)/python tests/mutants.py $(PACKAGES)

# Those that are left out measure errors, not speed, or take minutes.
SEPARATE := batch clean ray simulate stream truth
bench: setup ## Run the speed benchmarks, tests/bench/bench_*.py
	@set -e; for script in $(sort $(filter-out $(SEPARATE:%=tests/bench/bench_%.py),$(wildcard tests/bench/bench_*.py))); do echo "$$script"; $(BIN)/python "$$script"; done

bench-batch: setup ## Measure `batch`: overhead, memory, a second call, synthetic captures (CAPTURE= FILES= SYNTHETIC=)
	$(BIN)/python tests/bench/bench_batch.py $(if $(CAPTURE),"$(CAPTURE)") $(if $(FILES),--files "$(FILES)") $(if $(SYNTHETIC),--synthetic "$(SYNTHETIC)")

bench-clean: setup ## Compare every filter with the virtual Kinect's truth
	$(BIN)/python tests/bench/bench_clean.py

bench-ray: setup ## Compare the speed of training with Ray actors and with local processes
	OMP_NUM_THREADS=1 $(BIN)/python tests/bench/bench_ray.py

bench-simulate: setup ## Measure the page of simulate in real time, with a browser (MINUTES=10)
	$(BIN)/python tests/bench/bench_simulate.py $(MINUTES)

bench-stream: setup ## Compare ten live captures with the offline path (KINEMIMIC_CAPTURES= is their folder)
	$(BIN)/python tests/bench/bench_stream.py

bench-stream-exercises: setup ## Follow live captures of exercises with the policy for standing and without (KINEMIMIC_CAPTURES= is their folder)
	$(BIN)/python tests/bench/bench_stream_exercises.py

bench-stream-noise: setup ## Follow live captures of depth sensors with and without denoising (KINEMIMIC_CAPTURES= is their folder)
	$(BIN)/python tests/bench/bench_stream_noise.py

bench-stream-page: setup ## Time a frame over UDP to the browser; then a flood, a crowd and a kill (SECONDS= of each)
	$(BIN)/python tests/bench/bench_stream_page.py $(SECONDS)

hip-gap: setup ## Find what causes the gap at the hip: train with one setting of body, world or task changed at a time (hours): SEEDS=
	$(BIN)/python tests/bench/hip_gap.py datasets/policies/walk/motion.json runs/hip-gap $(if $(SEEDS),--seeds "$(SEEDS)")

# The folder of UI-PRMD is in KINEMIMIC_CAPTURES=, as for the tests (docs/contributing.md).
sensor-accuracy: setup ## Compare a Kinect's knee and hip with a Vicon's, before and after cleaning
	$(BIN)/python tests/bench/sensor_accuracy.py "$${KINEMIMIC_CAPTURES:-../shared/captures}" runs/sensor-accuracy
	$(BIN)/python tests/bench/azure_accuracy.py "$${KINEMIMIC_SENSORS:-../shared/sensors}" runs/sensor-accuracy

tracker-ablation: setup ## Train the tracker without each of its parts, two seeds (days): LIBRARY= of `make library` (SAMPLES=)
	$(BIN)/python tests/bench/tracker_ablation.py "$(LIBRARY)" runs/tracker-ablation $(if $(SAMPLES),--samples "$(SAMPLES)")

video-accuracy: setup ## Compare a video's knee and hip with optical capture's, with an ablation of the fit
	$(BIN)/python tests/bench/video_accuracy.py "$${KINEMIMIC_VIDEOS:-../shared/sensors/video_opencap}" runs/video-accuracy

bench-truth: setup ## Measure the error against the virtual Kinect's truth, by variability, sensor and speed
	$(BIN)/python tests/bench/bench_truth.py

profile: setup ## Profile the native engine with Linux's perf
	$(BIN)/python tests/bench/profile_step.py

# The wheel is built from the sdist, which proves that the sdist is complete.
wheel: setup ## Build dist/: kinemimic as sdist and pure-Python wheel, and kinemimic-native for any x86-64
	rm -rf build/lib
	$(BIN)/python -m build --no-isolation --outdir dist .
	KINEMIMIC_BULLET="$$($(if $(filter system,$(BULLET)),echo system,$(BIN)/python train/native/fetch.py build))" KINEMIMIC_ARCH= \
	  $(BIN)/python -m build --wheel --no-isolation --outdir dist train/native

install-test: setup ## Run all stages from a wheel in an empty environment beside Hugging Face's packages
	$(BIN)/python -m pytest -m slow tests/test_wheel.py

# .venv is removed with build/, which holds the links of the editable install. runs/ is kept: it holds hours of training.
clean: ## Remove everything that was built, except runs/
	rm -rf $(VENV) build dist site *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
