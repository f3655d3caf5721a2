"""What pyproject.toml cannot say: the text of the package page; everything else is there.

README.md links files of the repository, which a package index does not have. Where pyproject.toml
names the repository, `Repository` in `[project.urls]`, its links and pictures are made absolute.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from setuptools import setup

if sys.version_info >= (3, 11):
    import tomllib
else:
    from setuptools.compat.py310 import tomllib

TOP = Path(__file__).resolve().parent
_LINK = re.compile(r"(!?)(\[[^\]]*\]\()(?!https?:|#)([^)\s]+\))")


def package_page(text: str, repository: str) -> str:
    """A Markdown text whose links to files of the repository lead there; as it is without one.

    Args:
        text: Of the repository's top folder.
        repository: Its address, such as `https://example.org/owner/name`.
    """
    if not repository:
        return text

    def absolute(found: re.Match[str]) -> str:
        picture, label, path = found.groups()
        kind = "raw" if picture else "blob"
        return f"{picture}{label}{repository.rstrip('/')}/{kind}/HEAD/{path}"

    return _LINK.sub(absolute, text)


if __name__ == "__main__":
    project = tomllib.loads((TOP / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    readme = (TOP / "README.md").read_text(encoding="utf-8")
    setup(
        long_description=package_page(readme, project.get("urls", {}).get("Repository", "")),
        long_description_content_type="text/markdown",
    )
