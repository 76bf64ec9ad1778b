"""Other people's packages under the names of ours: ``agents`` and ``train`` are names that many choose."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Final

PACKAGES: Final = ("agents", "train")
"""Packages that come with this one."""


def overwritten(name: str) -> bool:
    """Whether another distribution has put its file in the place of our package's first one."""
    own = _own(name)
    # Each of ours begins with an import of aframe_env.
    return own.is_file() and "aframe_env" not in own.read_text(encoding="utf-8", errors="replace")


def in_the_way(name: str) -> str | None:
    """Return what Python finds in place of our package of that name, and what helps, in a sentence; None if ours."""
    spec = find_spec(name)
    if spec is None or (spec.origin == str(_own(name)) and not overwritten(name)):
        return None
    found = Path(spec.origin or next(iter(spec.submodule_search_locations or ())))
    owners = _owners(name, found)
    if owners:
        return (
            f"{found}, of {' and '.join(owners)}, stands in the way of aframe-heave's own package {name!r}: "
            "install the two into environments of their own (python -m venv)"
        )
    if _own(name).parent in (found, found.parent):
        return f"{found}: aframe-heave's own package {name!r} is damaged: pip install --force-reinstall aframe-heave"
    return (
        f"{found} stands in the way of aframe-heave's own package {name!r}: rename it, or run from another folder "
        "(and without its folder in PYTHONPATH)"
    )


def _own(name: str) -> Path:
    return Path(__file__).parents[1] / name / "__init__.py"


def _owners(name: str, file: Path) -> list[str]:
    """Other distributions that installed that file."""
    # Imported late: it is slow, and needed only where something is wrong.
    from importlib.metadata import distribution, packages_distributions

    others = set(packages_distributions().get(name, ())) - {"aframe-heave"}
    return sorted(each for each in others if file in [Path(f.locate()) for f in distribution(each).files or ()])
