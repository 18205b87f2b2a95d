"""The numbers behind the figures, as CSV files."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
from torch import Tensor

from ship_trl.explain.bootstrap import Estimate
from ship_trl.explain.pictures import SaliencyMaps
from ship_trl.explain.rows import Measured
from ship_trl.explain.states import StateSet
from ship_trl.files.disk import replacing
from ship_trl.learn.network import DuelingNetwork

Row = dict[str, Any]


def write_tables(
    output: Path, measured: Measured, states: StateSet, saliency: list[SaliencyMaps], picture: Tensor
) -> None:
    """Write every table into a folder; `picture` [C, 84, 84] is the one whose activations are drawn."""
    for name, rows in (
        ("probes", map(flatten, measured.probes)),
        ("cka", map(flatten, measured.cka)),
        ("layers", map(flatten, measured.by_layer)),
        ("erased", map(flatten, measured.erased)),
        ("states", state_rows(states)),
        ("saliency", saliency_rows(saliency)),
        ("filters", filter_rows(measured)),
        ("maps", activation_rows(measured.explained.network, picture)),
    ):
        with replacing(output / f"{name}.csv") as draft:
            pd.DataFrame(list(rows)).to_csv(draft, index=False)


def flatten(row: Any) -> Row:
    """Convert a row to columns; an estimate gives three."""
    values: Row = {}
    for field in dataclasses.fields(row):
        value = getattr(row, field.name)
        if isinstance(value, Estimate):
            ends = {f"{field.name}_low": value.low, f"{field.name}_high": value.high}
            values |= {field.name: value.value, **ends}
        else:
            values[field.name] = value
    return values


def state_rows(states: StateSet) -> Iterable[Row]:
    """List the states and their quantities, which are empty where they are not visible."""
    columns: Row = dict(zip(("x", "y", "heading", "step"), states.states.numpy().T, strict=True))
    columns |= {"episode": states.episode, "held_out": states.held_out, "random": states.random}
    for quantity in states.quantities:
        parts = ("sin", "cos") if quantity.kind == "bearing" else ("m",)
        for part, values in zip(parts, quantity.values.T, strict=True):
            columns[f"{quantity.name}, {part}"] = np.where(quantity.visible, values, np.nan)
    return (dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True))


def array_rows(axes: Sequence[str], **arrays: Any) -> Iterable[Row]:
    """List the elements of arrays of one shape, with their indices."""
    for index in np.ndindex(next(iter(arrays.values())).shape):
        yield dict(zip(axes, index, strict=True)) | {name: array[index] for name, array in arrays.items()}


def saliency_rows(saliency: list[SaliencyMaps]) -> Iterable[Row]:
    """List saliency by pixel."""
    for one in saliency:
        maps = {"gradient": one.gradient, "gradient_untrained": one.control, "occlusion": one.occlusion}
        for row in array_rows(("row", "column"), **maps):
            yield {"state": one.title} | row


def filter_rows(measured: Measured) -> Iterable[Row]:
    """List the weights of conv1 of every network."""
    for one in measured.networks:
        weight = one.network.get_parameter("conv1.weight").detach().numpy()
        for row in array_rows(("filter", "channel", "row", "column"), weight=weight):
            yield {"network": one.name} | row


@torch.no_grad()
def activation_rows(network: DuelingNetwork, picture: Tensor) -> Iterable[Row]:
    """List the activations of each layer for a picture; units of linear layers have row and column 0."""
    for layer, values in network.activations(picture[None]).items():
        maps = values[0].reshape(values.shape[1], *(values.shape[2:] or (1, 1))).numpy()
        for row in array_rows(("filter", "row", "column"), activation=maps):
            yield {"layer": layer} | row
