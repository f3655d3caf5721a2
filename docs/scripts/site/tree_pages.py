"""Files beside docs/ as pages of the site, and the links that lead to them.

A text belongs to a file of the tree, such as README.md; what it links is a file of the tree, too.
Both have a place on the site: docs/agents.md is agents.md there, README.md is index.md, and a file
of code is a page that shows it (or leads to the repository, where pyproject.toml names one).
"""

from __future__ import annotations

import os
import posixpath
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    import tomli as tomllib

TOP = Path(__file__).resolve().parents[3]
DOCS = TOP / "docs"
# files of the tree that are pages, by their place on the site
PAGES = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "benchmarks/README.md": "benchmarks.md",
}
_LINK = re.compile(r"(\]\()(?!https?:|mailto:|#)([^)#\s]+)(#[^)\s]*)?(\))")
_SHOWN = {".py": "python", ".toml": "toml", ".cff": "yaml"}  # others are text
CARDS = """
<div class="grid cards" markdown>

- **[A first drive](notebooks/first_drive.ipynb)**: drive a suite, read its table, open its page.
- **[If you come from CARLA](carla_users.md)**: your agent, maps, routes and result files here.
- **[If you come from RL](rl_users.md)**: `gymnasium.make`, many worlds, Stable-Baselines3.
- **[Why did it do that?](explain_page.md)**: gradients, attention, and what if.
- **[Leaderboard](leaderboard.md)**: records that can be checked, and how to hand in yours.
- **[Reference](reference/commands/index.md)**: commands, options, observations, edits, rules, API.

</div>

"""


def repository() -> str:
    """The repository's address without a slash at its end; empty where nobody has said one."""
    with (TOP / "pyproject.toml").open("rb") as file:
        urls = tomllib.load(file)["project"].get("urls", {})
    return str(urls.get("Repository", "")).rstrip("/")


def tree_pages() -> dict[str, str]:
    """Markdown of every page made of files beside docs/, by its place on the site."""
    pages = {}
    for source, place in PAGES.items():
        pages[place] = on_site((TOP / source).read_text(encoding="utf-8"), source)
    intro, start, rest = pages["index.md"].partition("## Start\n")
    pages["index.md"] = intro + CARDS.lstrip() + start + rest
    pages["cite.md"] = cite_page((TOP / "CITATION.cff").read_text(encoding="utf-8"))
    if not repository():
        pages |= {_code_place(path): _code_page(path) for path in sorted(_linked_code())}
    return pages


def on_site(text: str, source: str) -> str:
    """A text with links that lead to places on the site.

    Args:
        text: Markdown.
        source: The file of the tree that its links start from, such as `docs/agents.md`.
    """
    here = _place_of(source)

    def lead(found: re.Match[str]) -> str:
        before, target, anchor, after = found.groups()
        path = posixpath.normpath(posixpath.join(posixpath.dirname(source), target))
        if not (TOP / path).exists():
            return found.group()  # a page that the site makes
        place = _place_of(path)
        if not place.startswith("http"):
            place = posixpath.relpath(place, posixpath.dirname(here) or ".")
        return f"{before}{place}{anchor or ''}{after}"

    fenced = re.split(r"(^```.*?^```)", text, flags=re.MULTILINE | re.DOTALL)
    return "".join(part if part.startswith("```") else _LINK.sub(lead, part) for part in fenced)


def _place_of(path: str) -> str:
    """Where a file of the tree is on the site, or its address at the repository's host."""
    if path in PAGES:
        return PAGES[path]
    if path.startswith("docs/"):
        return path.removeprefix("docs/")
    if (TOP / path / "README.md").is_file():
        return _place_of(f"{path}/README.md")
    if address := repository():
        return f"{address}/{'tree' if (TOP / path).is_dir() else 'blob'}/HEAD/{path}"
    return "cite.md" if path == "CITATION.cff" else _code_place(path)


def _code_place(path: str) -> str:
    return f"source/{path}.md"


def _linked_code() -> set[str]:
    """Files and folders outside of docs/ that pages link and that are no pages themselves."""
    sources = [*PAGES, *(f"docs/{page.name}" for page in DOCS.glob("*.md"))]
    found = set()
    for source in sources:
        text = (TOP / source).read_text(encoding="utf-8")
        for _, target, _, _ in _LINK.findall(text):
            path = posixpath.normpath(posixpath.join(posixpath.dirname(source), target))
            if (TOP / path).exists() and _place_of(path) == _code_place(path):
                found |= {path, *_inside(path)}
    return found


def _inside(path: str) -> list[str]:
    """Python files of a folder; none of a file."""
    return [f"{path}/{file.name}" for file in sorted((TOP / path).glob("*.py"))]


def _code_page(path: str) -> str:
    """A page that shows a file, or lists the files of a folder."""
    head = f"---\nsearch:\n  exclude: true\n---\n# {path}\n\n"
    if (TOP / path).is_dir():
        here = posixpath.dirname(_code_place(path))
        files = [(name, posixpath.relpath(_code_place(name), here)) for name in _inside(path)]
        return head + "\n".join(f"- [`{name}`]({place})" for name, place in files) + "\n"
    text = (TOP / path).read_text(encoding="utf-8")
    language = _SHOWN.get(os.path.splitext(path)[1], "text")
    return f"{head}````{language}\n{text}````\n"


def not_in_menus(nav: Sequence[Any], more: Iterable[str]) -> list[str]:
    """Pages of docs/ that no menu names, in the order of their names: none is forgotten."""
    named = set(more)

    def take(entries: Any) -> None:
        for entry in entries:
            for what in entry.values() if isinstance(entry, dict) else [entry]:
                take(what) if isinstance(what, list) else named.add(what)

    take(nav)
    pages = sorted(page.name for page in DOCS.glob("*.md"))
    return [page for page in pages if page not in named and page not in REFERENCE_BY_HAND]


# pages by hand that stand in the menu of the reference
REFERENCE_BY_HAND = ("conventions.md", "rules.md")


def cite_page(cff: str) -> str:
    """How to cite, made of CITATION.cff."""
    import yaml  # MkDocs brings it

    content = yaml.safe_load(cff)
    paper = content["preferred-citation"]
    authors = " and ".join(
        f"{who['family-names']}, {who['given-names']}" for who in paper["authors"]
    )
    return f"""# Cite

{content["message"]}

```bibtex
@software{{driveinsight,
  title = {{{content["title"]}}},
  author = {{{" and ".join(who["name"] for who in content["authors"])}}},
  version = {{{content["version"]}}},
  license = {{{content["license"]}}}
}}

@article{{{paper["authors"][0]["family-names"].lower()}{paper["year"]}causality,
  title = {{{paper["title"]}}},
  author = {{{authors}}},
  journal = {{{paper["journal"]}}},
  year = {{{paper["year"]}}},
  url = {{{paper["url"]}}}
}}
```

A score names what it rests on: agent and version, suite and version, rules, seeds, world version.
`driveinsight show RUN` prints them, and [a run's folder](results.md) keeps them.

The same as a file that reference managers read, `CITATION.cff`:

```yaml
{cff.strip()}
```
"""
