"""The numbers behind the figures, as CSV."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
from torch import Tensor

from ship_trl.explain.bootstrap import Estimate
from ship_trl.explain.pictures import Looked
from ship_trl.explain.rows import Measured
from ship_trl.explain.states import StateSet
from ship_trl.files.disk import replacing
from ship_trl.learn.network import DuelingNetwork

Row = dict[str, Any]


def write_tables(
    output: Path, measured: Measured, drawn: StateSet, looked: list[Looked], picture: Tensor
) -> None:
    """Write every table into a folder; `picture` [C, 84, 84] is that whose maps are drawn."""
    for name, rows in (
        ("probes", map(flat, measured.probes)),
        ("cka", map(flat, measured.alike)),
        ("layers", map(flat, measured.by_layer)),
        ("erased", map(flat, measured.erased)),
        ("states", of_states(drawn)),
        ("saliency", of_saliency(looked)),
        ("filters", of_filters(measured)),
        ("maps", of_maps(measured.explained.network, picture)),
    ):
        with replacing(output / f"{name}.csv") as draft:
            pd.DataFrame(list(rows)).to_csv(draft, index=False)


def flat(row: Any) -> Row:
    """Give a row as columns; an estimate is three of them."""
    values: Row = {}
    for field in dataclasses.fields(row):
        value = getattr(row, field.name)
        if isinstance(value, Estimate):
            ends = {f"{field.name}_low": value.low, f"{field.name}_high": value.high}
            values |= {field.name: value.value, **ends}
        else:
            values[field.name] = value
    return values


def of_states(drawn: StateSet) -> Iterable[Row]:
    """Give each state and what there is to be read from it; nothing where that is not seen."""
    columns: Row = dict(zip(("x", "y", "heading", "step"), drawn.states.numpy().T, strict=True))
    columns |= {"episode": drawn.episode, "held_out": drawn.held_out, "random": drawn.random}
    for quantity in drawn.quantities:
        parts = ("sin", "cos") if quantity.kind == "bearing" else ("m",)
        for part, values in zip(parts, quantity.values.T, strict=True):
            columns[f"{quantity.name}, {part}"] = np.where(quantity.seen, values, np.nan)
    return (dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True))


def of_saliency(looked: list[Looked]) -> Iterable[Row]:
    """Give saliency pixel by pixel."""
    for one in looked:
        for row, column in np.ndindex(*one.fall.shape):
            yield {
                "state": one.title,
                "row": row,
                "column": column,
                "gradient": one.gradient[row, column],
                "gradient_untrained": one.control[row, column],
                "occlusion": one.fall[row, column],
            }


def of_filters(measured: Measured) -> Iterable[Row]:
    """Give the filters of the first layer of every network."""
    for one in measured.shown:
        weight = one.network.get_parameter("conv1.weight").detach().numpy()
        for (number, channel, row, column), value in np.ndenumerate(weight):
            place = {"channel": channel, "row": row, "column": column}
            yield {"network": one.name, "filter": number, **place, "weight": value}


@torch.no_grad()
def of_maps(network: DuelingNetwork, picture: Tensor) -> Iterable[Row]:
    """Give what each layer makes of a picture; a unit of a linear layer stands at row and column 0."""
    for layer, given in network.activations(picture[None]).items():
        maps = given[0].reshape(given.shape[1], *(given.shape[2:] or (1, 1))).numpy()
        for (number, row, column), value in np.ndenumerate(maps):
            yield {"layer": layer, "filter": number, "row": row, "column": column, "activation": value}
