"""The columns of the store: number, settings, status, metrics and time of a run."""

from __future__ import annotations

import math

import pyarrow as pa

from hexapod_cosim.cosim.results.metrics import METRICS
from hexapod_cosim.cosim.study.plan.identity import identity
from hexapod_cosim.cosim.study.plan.records import (
    GAINS,
    SCENARIO_FACTOR,
    VALUES,
    Factor,
    Study,
    Value,
)
from hexapod_cosim.cosim.study.store.run_result import RunResult

MACHINE_METRIC = "realtime_factor"  # depends on the machine
FIGURES = tuple(name for name in METRICS if name != MACHINE_METRIC)
UNITS = {name: unit for name, (unit, _, _) in METRICS.items()}
WALL = "wall"
WARNING_SEPARATOR = " | "


def schema_of(study: Study) -> pa.Schema:
    """Returns the schema of the store, with units in the metadata of its fields.

    A scenario that is a factor is in the column `case`.
    """
    fields = [
        pa.field("run", pa.int64()),
        pa.field("point", pa.int64()),
        pa.field("case", pa.string()),
    ]
    fields += [
        _with_unit(pa.field(factor.name, _type(factor)), _unit_of(factor))
        for factor in study.factors
        if factor.name != SCENARIO_FACTOR
    ]
    fields += [
        pa.field("seed", pa.int64()),
        pa.field("control", pa.string()),
        pa.field("status", pa.string()),
        pa.field("reason", pa.string()),
    ]
    fields += [
        pa.field("upright", pa.bool_()),
        pa.field("walked", pa.bool_()),
        pa.field("fallback", pa.float64()),
    ]
    fields += [
        pa.field("warnings", pa.string()),
        *(_with_unit(pa.field(name, pa.float64()), UNITS[name]) for name in FIGURES),
    ]
    fields += [pa.field("identity", pa.string()), _with_unit(pa.field(WALL, pa.float64()), "s")]
    return pa.schema(fields)


def result_schema(schema: pa.Schema) -> pa.Schema:
    """Returns the schema without the columns that differ between repetitions of a run."""
    return pa.schema([item for item in schema if item.name != WALL])


def _with_unit(item: pa.Field, unit: str) -> pa.Field:
    return item.with_metadata({"unit": unit}) if unit else item


def _unit_of(factor: Factor) -> str:
    return "designed gain" if factor.name.startswith(GAINS) and factor.relative else factor.unit


def _type(factor: Factor) -> pa.DataType:
    kinds = {type(value) for value in factor.values} if factor.kind == VALUES else {float}
    if kinds == {bool}:
        return pa.bool_()
    return pa.float64() if kinds <= {int, float} else pa.string()


def row_of(result: RunResult, study: Study) -> dict[str, object]:
    """Returns the row of a run: its values by column."""
    order, summary = result.order, result.summary
    values = {
        factor.name: _cell(factor, value)
        for factor, value in zip(study.factors, order.values, strict=True)
        if factor.name != SCENARIO_FACTOR
    }
    return {
        "run": order.run,
        "point": order.point,
        "case": order.case,
        **values,
        "seed": order.seed,
        "control": order.control,
        "status": summary.status,
        "reason": summary.reason,
        "upright": summary.upright,
        "walked": summary.walked,
        "fallback": summary.fallback,
        "warnings": WARNING_SEPARATOR.join(summary.warnings),
        **{
            name: None if math.isnan(summary.metrics[name]) else summary.metrics[name]
            for name in FIGURES
        },
        "identity": identity(order, study.factors),
        WALL: result.wall,
    }


def _cell(factor: Factor, value: Value | None) -> Value | None:
    """Converts the value of a factor to the type of its column."""
    if value is None:
        return None
    kind = _type(factor)
    if kind == pa.string():
        return str(value).lower() if isinstance(value, bool) else str(value)
    return value if kind == pa.bool_() else float(value)
