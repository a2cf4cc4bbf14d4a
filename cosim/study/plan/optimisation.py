"""Numbers the runs of an optimisation."""

from __future__ import annotations

from itertools import product

from hexapod_cosim.cosim.study.plan.records import Evaluation, Order, Study, Value


class Optimisation:
    """Numbers the runs: those of all trials, of the unchanged settings, then the held-out ones."""

    def __init__(self, study: Study) -> None:
        assert study.optimise is not None
        self.study, self.asked = study, study.optimise
        self.trained, self.most = self.asked.trained, self.asked.most

    def training(self, point: int, values: tuple[Value | None, ...]) -> list[Order]:
        """Returns the training runs of a trial, whose number is `point`."""
        return self._orders(self.asked.training, point * self.asked.training.runs, point, values)

    def held_out(self, place: int, point: int, values: tuple[Value | None, ...]) -> list[Order]:
        """Returns the held-out runs of the settings that are evaluated as number `place`."""
        return self._orders(
            self.asked.held_out, self.trained + place * self.asked.held_out.runs, point, values
        )

    def _orders(
        self, evaluation: Evaluation, first: int, point: int, values: tuple[Value | None, ...]
    ) -> list[Order]:
        pairs = enumerate(product(evaluation.cases, evaluation.seeds))
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
        """The values that leave all variables as the scenarios have them."""
        return (None,) * len(self.study.factors)
