.PHONY: figures
help-extensions::
	@echo "make figures   the course, and the tables of the pages that compare controls: README.md, docs/ (10 min)"

figures: setup
	$(BIN)/hexapod benchmark -o out/benchmark
	$(BIN)/python -m benchmarks.course.pages out/benchmark
