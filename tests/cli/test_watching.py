"""Cases at work, as lines and as a page."""

import pytest
from commands import typed
from lxml import html

from radcal.cli import watching
from radcal.forecast.runs_and_time import Standing
from radcal.storage.lock import CaseLock


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.yaml").write_text("case: mine\n")
    folder = tmp_path / "results" / "mine"
    (folder / "logs").mkdir(parents=True)
    (folder / "logs/scene.progress").write_text("scene: 3 < 4 cells")
    return folder


def test_a_case_is_shown_until_no_command_works_on_it(folder, monkeypatch):
    lock = CaseLock(folder)
    lock.acquire()
    pages = []

    def sleep(seconds):
        pages.append((folder / "live.html").read_text())
        if len(pages) == 2:
            (folder / "logs/geometry.progress").write_text("geometry: image")
        if len(pages) == 3:
            lock.release()

    monkeypatch.setattr(watching.time, "sleep", sleep)
    done = typed("show", "mine.yaml", "--watch", "--html")
    # at the start, after the news, and at the end
    assert done.stdout.count("mine: not finished") == 3
    assert done.stdout.count("simulator: 0 of about ") == 2
    assert done.stdout.count("live page: results/mine/live.html") == 3
    first = html.document_fromstring(pages[0])
    assert first.xpath("//meta[@http-equiv='refresh']/@content") == ["5"]
    assert float(first.xpath("//progress/@value")[0]) == 0
    assert first.xpath("//li/text()") == ["scene: 3 < 4 cells"]
    assert sorted(html.document_fromstring(pages[2]).xpath("//li/text()")) == ["geometry: image", "scene: 3 < 4 cells"]
    last = html.document_fromstring((folder / "live.html").read_text())
    assert not last.xpath("//meta[@http-equiv='refresh'] | //progress | //a")


def test_the_page_of_a_finished_case_leads_to_its_report(folder):
    (folder / "report.html").touch()
    page = html.document_fromstring(watching.live_page(folder, ["a < b"], Standing(9, None, None), at_work=False))
    assert page.xpath("//a/@href") == ["report.html"]
    assert page.xpath("//p/text()") == ["a < b"]
    assert page.xpath("//progress/@max") == ["9"]
    page = html.document_fromstring(watching.live_page(folder, [], Standing(9, 15, None), at_work=True))
    assert not page.xpath("//a")
    assert page.xpath("//progress/@max") == ["15"]


def test_a_page_is_written_by_watching_alone(folder):
    done = typed("show", "mine", "--html", code=1)
    assert done.stderr == "radcal: --html is given without --watch, expected both.\n"
    gone = typed("show", "gone", "--watch", code=1)
    assert gone.stdout == ""
    assert gone.stderr.startswith("radcal: gone: there is no folder results/gone")
