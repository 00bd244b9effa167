"""The site needs no network, shows formulas without scripts, and says one version with everything else."""

import re
import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path

import pytest

from ac_common.yaml_file import parsed
from docs.tools.reproduction_page import FOLDER, PAGE, text

ROOT = Path(__file__).parents[2]
VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built as the README says."""
    assert "    python3 start.py mkdocs build --strict " in (ROOT / "README.md").read_text(encoding="utf-8")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-3000:]
    return folder


def test_no_page_loads_anything_from_elsewhere(site: Path) -> None:
    pages = list(site.rglob("*.html"))
    assert len(pages) > 15
    for page in pages:
        html = page.read_text(encoding="utf-8")
        loaded = re.findall(r"<(?:script|img|iframe)[^>]*\ssrc=[\"']?([^\"' >]+)", html)
        loaded += re.findall(r"<link[^>]*rel=[\"']?(?:stylesheet|preconnect|icon)[^>]*href=[\"']?([^\"' >]+)", html)
        assert loaded
        assert not [address for address in loaded if address.startswith(("http:", "https:", "//"))], page
    for style in site.rglob("*.css"):
        assert not re.search(r"url\([\"']?(https?:)?//", style.read_text(encoding="utf-8")), style


def test_formulas_are_mathml(site: Path) -> None:
    html = (site / "theory" / "structure.html").read_text(encoding="utf-8")
    assert html.count("<math") > 30
    assert "arithmatex" not in html
    assert "$$" not in html


def test_examples_are_shown_on_their_pages(site: Path) -> None:
    for page in (ROOT / "docs").rglob("*.md"):
        assert not re.search(r"^(--8<--|:::) ", page.read_text(encoding="utf-8"), re.MULTILINE), page
    assert "LinearPlantNode" in (ROOT / "docs" / "how-to" / "own-plant.md").read_text(encoding="utf-8")
    assert "LinearPlantNode" in (site / "how-to" / "own-plant.html").read_text(encoding="utf-8")


def test_search_works_from_files(site: Path) -> None:
    assert (site / "search" / "search_index.js").read_text(encoding="utf-8").startswith("var __index = ")
    assert "iframe-worker" in (site / "index.html").read_text(encoding="utf-8")


def test_every_page_is_in_the_navigation() -> None:
    text_ = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    missing = [
        page.relative_to(ROOT / "docs").as_posix()
        for page in (ROOT / "docs").rglob("*.md")
        if page.relative_to(ROOT / "docs").as_posix() not in text_
    ]
    assert not missing, "add it to `nav` in mkdocs.yml"


def test_reproduction_page_is_that_of_its_figures() -> None:
    import json

    content = json.loads((FOLDER / "paper.json").read_text(encoding="utf-8"))
    assert PAGE.read_text(encoding="utf-8") == text(content), "run `python -m docs.tools.reproduction_page`"
    assert {item["figure"] for item in content.values() if item["figure"]} == {f.name for f in FOLDER.glob("*.svg")}


def test_citation_agrees_with_the_project() -> None:
    citation = parsed((ROOT / "CITATION.cff").read_text(encoding="utf-8"), "CITATION.cff")
    assert citation["version"] == VERSION
    assert citation["license"] == "Apache-2.0"
    assert {"cff-version", "message", "title", "authors"} <= set(citation)


def test_changelog_has_the_unreleased_heading_or_the_version() -> None:
    headings = re.findall(r"^## \[([^\]]+)\]", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert headings[0] in ("Unreleased", VERSION)


PACKAGES = sorted(path.parent.name for path in ROOT.glob("*/__init__.py"))
FOLDERS = "|".join([*PACKAGES, "docs", "examples", "layouts", "tests"])
PAGES = [*(ROOT / "docs").rglob("*.md"), *ROOT.glob("*/README.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]


def test_paths_that_the_documentation_names_exist() -> None:
    """What stands in backquotes and has a folder of ours in front."""
    missing = []
    for page in PAGES:
        named = re.findall(rf"`((?:{FOLDERS})/[\w./-]+)`", page.read_text(encoding="utf-8"))
        missing += [f"{page.name}: {path}" for path in named if not (ROOT / path).exists()]
    assert not missing


def test_modules_and_scripts_that_the_documentation_runs_exist() -> None:
    """`python -m NAME` and `python FILE`; the page of what has moved names old modules in its left columns."""
    missing = []
    for page in PAGES:
        text_ = re.sub(r"^\| `python -m [^|]*\|", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
        modules = re.findall(rf"python\s+-m\s+((?:{FOLDERS})[\w.]*\w)", text_)
        missing += [f"{page.name}: {name}" for name in modules if find_spec(name) is None]
        scripts = re.findall(rf"python\s+((?:{FOLDERS})/[\w./-]+)", text_)
        missing += [f"{page.name}: {path}" for path in scripts if not (ROOT / path).exists()]
    assert not missing
