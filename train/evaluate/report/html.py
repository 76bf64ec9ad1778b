"""The page: what the report shows, put into one HTML file that needs nothing else."""

from __future__ import annotations

import base64
import gzip
import json
import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from jinja2 import Environment, PackageLoader, StrictUndefined
from plotly.offline import get_plotlyjs

from agents.policy import Knowledge
from train.evaluate.report.data import Content, Subset, content
from train.evaluate.run import Comparison
from train.evaluate.statistics import Row
from train.shared.run_folder import versions, write_text

MODELS: Final = {"simplified": "simplified (rigid frame)", "rfem": "full (flexible frame, rigid finite elements)"}
KINDS: Final = (Knowledge.STATE, Knowledge.SENSORS, Knowledge.CLOCK, Knowledge.NOTHING, Knowledge.FUTURE)
"""Order of the table's groups: privileged policies come last, apart from all others."""

SMALLEST_PLAIN: Final = 1e-4
"""Smaller figures are written with a power of ten."""
RAISED: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def write_report(path: Path, comparison: Comparison, command: str) -> None:
    """Write the report of a comparison that ``command`` made, all or nothing; it opens in any browser, offline."""
    write_text(path, _page(comparison, command))


def _page(comparison: Comparison, command: str) -> str:
    environment = Environment(
        loader=PackageLoader("train.evaluate", "report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"percent": percent, "figure": figure}
    shown = content(comparison)
    return environment.get_template("page.html.j2").render(
        command=command,
        versions=versions(),
        model=MODELS[comparison.config.model],
        modes=comparison.config.rfem_modes,
        duration=comparison.config.duration,
        policies=len(comparison.entries),
        count=len(comparison.scenarios),
        ranges=_ranges(shown),
        content=shown,
        groups=[[(kind.value, _group(shown, subset, kind)) for kind in KINDS] for subset in shown.subsets],
        future=Knowledge.FUTURE.value,
        style=_source("page.css"),
        script=_source("page.js"),
        plotly=_packed(get_plotlyjs()),
        data=_packed(json.dumps(_without_nan(asdict(shown)), ensure_ascii=False, allow_nan=False)),
    )


def _group(shown: Content, subset: Subset, kind: Knowledge) -> list[tuple[int, Row, int]]:
    """Place, figures and family of the policies that know so much, the best first; seeds stand below their family."""

    def order(place: int) -> tuple[float, int, bool, float]:
        family = shown.policies[place].family
        return -subset.figures[family].reduction.value, family, place != family, -subset.figures[place].reduction.value

    places = [i for i, policy in enumerate(shown.policies) if policy.knows == kind.value]
    return [(i, subset.figures[i], shown.policies[i].family) for i in sorted(places, key=order)]


def _ranges(shown: Content) -> list[tuple[str, float, float]]:
    return [(dependence.label, min(dependence.x), max(dependence.x)) for dependence in shown.dependences]


def percent(share: float) -> str:
    """A share in per cent: finer where it is close to all, coarser where it is far below nothing."""
    digits = 2 if 0.99 < share < 1.0 else 1 if share > -1.0 else 0
    return f"{share:.{digits}%}".replace("-", "−").replace("%", "\u00a0%")


def figure(value: float, digits: int = 3) -> str:
    """A value to so many significant digits."""
    if value == 0.0:
        return "0"
    if abs(value) < SMALLEST_PLAIN:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        return f"{mantissa}·10{str(int(exponent)).translate(RAISED)}".replace("-", "−")
    places = digits - 1 - math.floor(math.log10(abs(value)))
    return f"{round(value, places):,.{max(0, places)}f}".replace("-", "−")


def _source(name: str) -> str:
    return Path(__file__).with_name(name).read_text(encoding="utf-8")


def _packed(text: str) -> str:
    """Compressed, as characters that may stand anywhere in a page; the same text gives the same characters."""
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode()


def _without_nan(data: Any) -> Any:
    """JSON has no NaN: null in its place."""
    if isinstance(data, float):
        return data if math.isfinite(data) else None
    if isinstance(data, Mapping):
        return {key: _without_nan(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_without_nan(value) for value in data]
    return data
