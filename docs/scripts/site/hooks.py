"""What the site is made of beside docs/*.md: MkDocs calls these as it builds (mkdocs.yml).

Pages written by hand link each other as files, so that they work on a repository host. Here files
that are not under docs/ become pages too, and links lead to these.
"""

from __future__ import annotations

from typing import Any

import reference_pages
import tree_pages
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

HOW_TO = (
    *("python.md", "agents.md", "environments.md", "scenarios.md", "running.md", "results.md"),
    *("report.md", "branching.md", "explain_page.md", "explaining.md", "interventions.md"),
    *("studies.md", "training.md", "hub.md", "zoo.md"),
)


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Says where the repository is, if pyproject.toml does, and fills in the two long menus."""
    config.repo_url = tree_pages.repository() or None
    config.edit_uri = "" if config.repo_url is None else "edit/HEAD/docs/"
    assert config.nav is not None
    menus: dict[str, list[Any]] = {
        "How to": [*HOW_TO, *tree_pages.not_in_menus(config.nav, HOW_TO)],
        "Reference": reference_pages.menu(),
    }
    config.nav = [
        {title: menus.get(title, what) for title, what in entry.items()}
        if isinstance(entry, dict)
        else entry
        for entry in config.nav
    ]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds the pages that are made: of files elsewhere in the tree, and of the code."""
    pages = {**tree_pages.tree_pages(), **reference_pages.reference_pages()}
    for place, text in pages.items():
        files.append(File.generated(config, place, content=text))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Leads links of a page by hand to where things are on the site."""
    return tree_pages.on_site(markdown, f"docs/{page.file.src_uri}")
