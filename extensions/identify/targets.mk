.PHONY: identify-campaign bench-servos
help-extensions::
	@echo "make identify-campaign  20 robots with secret numbers, identified from logs of 6 s (10 min); ROBOTS, SECONDS, AT_A_TIME; goes on with out/identification_SECONDS.csv"
	@echo "make bench-servos  presets of servos against logs of real ones; XL330=FOLDER, KSCALE=FOLDER: of BAM, of K-Scale"

ROBOTS ?= 20
SECONDS ?= 6
AT_A_TIME ?= 1
identify-campaign: setup
	PYTHONPATH=tests/support:tests/identify $(BIN)/python -m benchmarks.identify.robots --robots $(ROBOTS) --seconds $(SECONDS) \
		--workers $(AT_A_TIME) --table out/identification_$(SECONDS).csv

# XL330=FOLDER: logs of Rhoban/bam; KSCALE=FOLDER: the raw logs of kscalelabs/sysid
bench-servos: setup
	$(BIN)/python -m benchmarks.identify.servos $(if $(XL330),--xl330 $(XL330)) $(if $(KSCALE),--kscale $(KSCALE)) --pictures docs/images -o benchmarks/results/servos.csv
	$(BIN)/python -m benchmarks.identify.hip
