"""The two things that pyproject.toml cannot say: agents in the wheel, and a README whose links work anywhere."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

SHIPPED = (
    "agents/*/seed-0/agent.json",
    "agents/*/seed-0/agent.safetensors",
    "agents/*/seed-0/recurrent.json",
    "agents/*/seed-0/recurrent.safetensors",
    "drive-map/drive_map.json",
    "drive-map/drive_map.safetensors",
    "tasks/*/ceiling*.json",
)
"""What of ``results`` goes into the wheel: see ``agents/shipped.py``."""


class BuildWithAgents(build_py):
    """Put one seed of each agent, the drive map and the ceilings into the package from where commands wrote them."""

    def run(self) -> None:
        """Build the packages; an editable install finds the agents where they are."""
        super().run()
        if self.editable_mode:
            return
        for pattern in SHIPPED:
            for source in Path("results").glob(pattern):
                target = Path(self.build_lib, "agents", "data", source.relative_to("results"))
                self.mkpath(str(target.parent))
                self.copy_file(str(source), str(target))


def absolute_links(text: str, repository: str) -> str:
    """Let relative links of a Markdown text lead to the repository, and its relative pictures come from there."""
    text = re.sub(r"(!\[[^]]*\]\()(?![a-z]+:|#)", rf"\g<1>{repository}/raw/main/", text)
    return re.sub(r"((?<!!)\[[^]]*\]\()(?![a-z]+:|#)", rf"\g<1>{repository}/blob/main/", text)


project = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["project"]
setup(
    cmdclass={"build_py": BuildWithAgents},
    long_description=absolute_links(Path("README.md").read_text(encoding="utf-8"), project["urls"]["Repository"]),
    long_description_content_type="text/markdown",
)
