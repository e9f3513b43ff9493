"""Links of README, CONTRIBUTING and `docs/` lead somewhere, and generated tables are those of the code."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")


def prose(page):
    """Text of a page without blocks and spans of code."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    return re.sub(r"^ {4}.*$|`[^`]*`", "", text, flags=re.MULTILINE)


def anchors(page):
    """Names by which a link reaches the headings of a page, as GitHub and MyST make them."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files_and_headings(page):
    broken = []
    for link in LINK.findall(prose(page)):
        if "://" in link or link.startswith("mailto:"):
            continue
        path, _, heading = link.partition("#")
        target = page.parent / path if path else page
        if not target.exists() or (heading and heading not in anchors(target)):
            broken.append(link)
    assert broken == []


def test_every_page_of_the_site_is_in_its_contents():
    listed = set(re.findall(r"^(\w+)$", (ROOT / "docs/index.md").read_text(encoding="utf-8"), flags=re.MULTILINE))
    pages = [*(ROOT / "docs").glob("*.md"), *(ROOT / "docs").glob("*.ipynb")]
    assert {page.stem for page in pages} - {"index"} == listed


@pytest.mark.parametrize(
    ("name", "page"),
    [("laws", "laws"), ("sensors", "sensors"), *((name, "landcover") for name in ("esa_worldcover", "corine", "nlcd"))],
)
def test_a_page_has_its_generated_table(name, page):
    command = [sys.executable, ROOT / "docs/tables.py", name]
    table = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert len(table.splitlines()) > 2
    assert table in (ROOT / f"docs/{page}.md").read_text(encoding="utf-8")


def test_pictures_are_shown_in_a_page():
    shown = {(page.parent / link).resolve() for page in PAGES for link in LINK.findall(prose(page))}
    assert set((ROOT / "docs").glob("*.png")) - shown == set()


def test_cases_in_the_pages_are_yaml():
    blocks = [block for page in PAGES for block in re.findall(r"(?ms)^```yaml$(.*?)^```$", page.read_text("utf-8"))]
    assert len(blocks) > 2
    assert all(isinstance(yaml.safe_load(block), dict) for block in blocks)
