"""The numbers of all runs of an optimisation: trials, the start, then the held-out runs."""

from __future__ import annotations

from itertools import product

from hexapod_cosim.cosim.study.plan.records import Judging, Order, Study, Value


class Optimisation:
    """The numbers of all its runs: trials, the beginning (no setting at all), then the held-out
    runs.
    """

    def __init__(self, study: Study) -> None:
        assert study.optimise is not None
        self.study, self.asked = study, study.optimise
        self.trained, self.most = self.asked.trained, self.asked.most

    def training(self, point: int, values: tuple[Value | None, ...]) -> list[Order]:
        """The training runs of a trial."""
        return self._orders(self.asked.training, point * self.asked.training.runs, point, values)

    def held_out(self, place: int, point: int, values: tuple[Value | None, ...]) -> list[Order]:
        """The held-out runs of the `place`-th of what is tried in the end."""
        return self._orders(
            self.asked.held_out, self.trained + place * self.asked.held_out.runs, point, values
        )

    def _orders(
        self, judging: Judging, first: int, point: int, values: tuple[Value | None, ...]
    ) -> list[Order]:
        pairs = enumerate(product(judging.cases, judging.seeds))
        return [
            Order(
                run=first + k,
                point=point,
                case=case,
                values=values,
                seed=seed,
                control=self.asked.control,
            )
            for k, (case, seed) in pairs
        ]

    @property
    def unset(self) -> tuple[None, ...]:
        """The values that leave all as it is without the study."""
        return (None,) * len(self.study.factors)
