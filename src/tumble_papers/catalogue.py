"""The papers' items: every table, figure and claim that can be made anew."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from importlib.resources import files

from tumble.reproduction.items import Item, measured_costs
from tumble_papers.hayal.chapter_4 import (
    reproduce_convergence,
    reproduce_figure,
    reproduce_norm_bias,
    reproduce_table,
)
from tumble_papers.hayal.positions import (
    reproduce_outage_figure,
    reproduce_scenario_figure,
    reproduce_scenario_positions,
    reproduce_sub_scenarios,
)
from tumble_papers.hayal.scenarios import TABLES, reproduce_scenario_table
from tumble_papers.published import hayal, savage, zhang
from tumble_papers.savage.accuracy import reproduce_accuracy
from tumble_papers.savage.formulas import reproduce_equation_12
from tumble_papers.savage.formulas import reproduce_table_1 as reproduce_savage_table_1
from tumble_papers.savage.formulas import reproduce_table_2 as reproduce_savage_table_2
from tumble_papers.savage.section_9 import (
    reproduce_accelerometer_noise,
    reproduce_earth_rate,
    reproduce_gyro_bias,
    reproduce_random_noise,
)
from tumble_papers.zhang.navigation import reproduce_measurements, reproduce_positions
from tumble_papers.zhang.sensitivity import reproduce_designs, reproduce_sensitivity
from tumble_papers.zhang.tables import reproduce_figure as reproduce_norm_errors
from tumble_papers.zhang.tables import (
    reproduce_scatter_table,
    reproduce_table_2,
    reproduce_table_5,
    reproduce_table_6,
)


def _hayal_items() -> list[Item]:
    tables = hayal()["tables"]
    items = [
        Item(f"hayal-{t}", f"table {t}: {tables[t]['title']}", partial(reproduce_table, t))
        for t in ("4.2", "4.3", "4.4", "4.5")
    ]
    items += [
        Item(
            "hayal-figure-4.2",
            "figure 4.2: gyros against the reference rate",
            partial(reproduce_figure, "4.2"),
            20,
        ),
        Item(
            "hayal-figure-4.3",
            "figure 4.3: gyros against the noise",
            partial(reproduce_figure, "4.3"),
            20,
        ),
        Item("hayal-convergence", "how often the gyro solutions converge", reproduce_convergence, 500),
        Item(
            "hayal-norm-bias",
            "how far noise biases the estimators of the norm",
            reproduce_norm_bias,
            500,
        ),
    ]
    items += [
        Item(
            f"hayal-{t}",
            f"table {t}: {tables[t]['title']}",
            partial(reproduce_scenario_table, t),
        )
        for t in TABLES
    ]
    return items + _position_items()


def _position_items() -> list[Item]:
    tables = hayal()["position_tables"]
    items = [
        Item(
            f"hayal-{t}",
            f"table {t}: {tables[t]['title']}",
            partial(reproduce_scenario_positions, t),
            8,
            dear=True,
        )
        for t in ("5.5", "5.6")
    ]
    title = f"table 5.7: {tables['5.7']['title']}"
    wandering = partial(reproduce_sub_scenarios, wandering=True)
    items += [
        Item("hayal-5.7", title, reproduce_sub_scenarios, 6, dear=True),
        Item("hayal-5.7-wandering", "the same with biases that wander", wandering, 4, dear=True),
    ]
    items += [
        Item(
            f"hayal-figure-{f}",
            f"figure {f}: table {f} as a picture",
            partial(reproduce_scenario_figure, f),
            8,
            dear=True,
        )
        for f in ("5.5", "5.6")
    ]
    return items + [
        Item(
            f"hayal-figure-{f}",
            f"figure {f}: table 5.7 as a picture, {imu}",
            partial(reproduce_outage_figure, f),
            6,
            dear=True,
        )
        for f, imu in (("5.7", "HG1700"), ("5.8", "HG1900"))
    ]


def _zhang_items() -> list[Item]:
    printed = zhang()
    tables, figures = printed["tables"], printed["figures"]
    runs = {
        "2": reproduce_table_2,
        "3": partial(reproduce_scatter_table, "3"),
        "4": partial(reproduce_scatter_table, "4"),
        "5": reproduce_table_5,
        "6": reproduce_table_6,
    }
    items = [Item(f"zhang-{t}", f"table {t}: {tables[t]['title']}", run, 500) for t, run in runs.items()]
    items += [
        Item(
            f"zhang-figure-{f}",
            f"figure {f}: {figures[f]['title']}",
            partial(reproduce_norm_errors, f),
            500,
        )
        for f in figures
    ]
    items += _zhang_navigation_items()
    items += [
        Item("zhang-sensitivity", "where a norm shows most of each parameter", reproduce_sensitivity, None),
        Item(
            "zhang-designs",
            "what sets of poses determine, the paper's and better ones",
            reproduce_designs,
            500,
        ),
    ]
    return items


def _zhang_navigation_items() -> list[Item]:
    items: list[Item] = []
    for name, entry in zhang()["navigation_tests"].items():
        for sensor, figure in entry["measurements"].items():
            words = "specific forces" if sensor == "accelerometer" else "angular rates"
            title = f"figure {figure}: {words} in navigation test {name}"
            run = partial(reproduce_measurements, figure)
            items.append(Item(f"zhang-figure-{figure}", title, run, 1))
        figure = entry["positions"]
        title = f"figure {figure}: errors of position in navigation test {name}, three methods"
        run = partial(reproduce_positions, figure)
        items.append(Item(f"zhang-figure-{figure}", title, run, 20, dear=True))
    return items


def _savage_items() -> list[Item]:
    tables = savage()["tables"]
    return [
        Item("savage-1", f"table 1: {tables['1']['title']}", reproduce_savage_table_1, None),
        Item("savage-2", f"table 2: {tables['2']['title']}", reproduce_savage_table_2, None),
        Item("savage-12", "(12): what each error does to each measurement", reproduce_equation_12, None),
        Item("savage-9.1", "section 9.1: gyro random noise", reproduce_random_noise, 200),
        Item("savage-9.2", "section 9.2: accelerometer noise", reproduce_accelerometer_noise, 200),
        Item("savage-9.3", "section 9.3: Earth rate", reproduce_earth_rate, 200),
        Item("savage-9.4", "section 9.4: gyro bias", reproduce_gyro_bias, 200),
        Item(
            "savage-accuracy",
            "accuracy of the test: three grades, ways to evaluate it, play-backs",
            reproduce_accuracy,
            200,
        ),
    ]


_COSTS = measured_costs(files("tumble_papers") / "costs.json")

ITEMS: dict[str, Item] = {
    item.name: replace(item, cost=_COSTS.get(item.name, (0.0, 0.0)))
    for item in (*_hayal_items(), *_zhang_items(), *_savage_items())
}
"""Every item by name, a paper after the other, each in its own order: the entry point `tumble.reproduction`."""
