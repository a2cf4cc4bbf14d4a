.PHONY: identify-campaign
help-extensions::
	@echo "make identify-campaign  20 robots with secret numbers, identified from logs of 6 s (10 min); ROBOTS, SECONDS, AT_A_TIME; goes on with out/identification_SECONDS.csv"

ROBOTS ?= 20
SECONDS ?= 6
AT_A_TIME ?= 1
identify-campaign: setup
	PYTHONPATH=tests/support:tests/identify $(BIN)/python -m benchmarks.identification --robots $(ROBOTS) --seconds $(SECONDS) \
		--workers $(AT_A_TIME) --table out/identification_$(SECONDS).csv
