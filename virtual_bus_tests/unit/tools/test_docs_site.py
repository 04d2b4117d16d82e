"""The generated parts of the documentation: files and their purposes, docstrings, commands, messages, decisions."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from canbase_cli.main import app
from canbase_driver.supervision.phases import Phase
from site_builder import (
    api_pages,
    command_page,
    decision_page,
    figures,
    message_page,
    offline,
    source_pages,
    state_picture,
    structure,
)
from site_builder.docstrings import converted
from site_builder.modules import ROOT, Module, modules, purpose, shipped_packages

RECORDS = {int(record.name[:4]): record for record in sorted((ROOT / "docs" / "decisions").glob("*.md"))}
ALL = [module for package in shipped_packages() for module in modules(package)]


def test_the_page_of_files_has_every_shipped_module_with_its_first_line() -> None:
    page = structure.page(ROOT)

    assert [module for module in ALL if module.purpose.replace("|", "∣") not in page] == []
    assert page.count("\n## `") == len({module.path.parent for module in ALL})


def test_the_picture_of_the_states_is_the_one_of_the_table() -> None:
    drawn = (ROOT / "docs" / "states.svg").read_text(encoding="utf-8")
    assert drawn == state_picture.picture(), "out of date: run `make structure`"
    assert set(state_picture.AT) == set(Phase)
    ends = {after for _, after in state_picture.edges()} | set(state_picture.waits())
    assert ends == set(Phase), "each state can be reached"


def test_each_figure_in_a_sentence_is_the_one_that_was_measured() -> None:
    pages = figures.pages(ROOT)
    assert [path.name for path, text in pages.items() if text != path.read_text("utf-8")] == [], "run `make structure`"
    used = {name for text in pages.values() for name in re.findall(r"<!-- figure ([^>]*?) -->", text)}
    assert used == set(figures.figures(ROOT))


def test_a_file_has_a_line_on_the_page_of_files(tmp_path: Path) -> None:
    (tmp_path / "pyproject.toml").write_text('[tool.scikit-build]\nwheel.packages = ["arm/canbase_arm"]\n')
    folder = tmp_path / "arm" / "canbase_arm"
    folder.mkdir(parents=True)
    (folder / "__init__.py").write_text('"""The arm."""\n')
    (folder / "joint.py").write_text('"""One joint.\n\nMore of it.\n"""\n')

    assert structure.page(tmp_path).endswith(
        "\n\n## `arm/canbase_arm/`\n\nThe arm.\n\n| file | purpose |\n|---|---|\n| `joint.py` | One joint. |\n"
    )


def test_a_file_without_a_docstring_is_an_error_that_names_it(tmp_path: Path) -> None:
    file = tmp_path / "mute.py"
    file.write_text("x = 1\n")

    with pytest.raises(ValueError, match=r"mute\.py has no docstring"):
        purpose(file)


@pytest.mark.parametrize("module", ALL, ids=lambda module: module.name)
def test_the_first_line_of_a_docstring_is_a_whole_sentence(module: Module) -> None:
    assert module.purpose.endswith("."), f"{module.path}: {module.purpose}"


def test_the_api_pages_have_every_shipped_module_that_can_be_imported() -> None:
    pages = api_pages.pages(ROOT)
    documented = {line.split(":: ")[1] for page in pages.values() for line in page.splitlines() if "automodule" in line}

    assert documented == {module.name for module in ALL if module.path.name != "__main__.py"}
    assert all(f"api/{Path(name).stem}\n" in pages["api.rst"] for name in pages if name != "api.rst")


def test_the_page_of_commands_has_every_command() -> None:
    page = command_page.page()

    for command in app.registered_commands:
        assert f"\n## `canbase {command.name}`\n" in page
    for group in app.registered_groups:
        assert f"\n## `canbase {group.name}`\n" in page


def test_the_page_of_messages_has_every_definition_and_its_comments() -> None:
    page = message_page.page(ROOT)

    assert "## canbase/action/DriveDistance\n" in page
    assert "# Distance to drive [m]. Positive: forward (+x of base_link, REP 103). Negative: backward.\n" in page
    assert page.count("\n## canbase/") == len(list((ROOT / "interfaces" / "msg").iterdir())) + len(
        list((ROOT / "interfaces" / "action").iterdir())
    )


def test_the_page_of_decisions_has_every_record() -> None:
    page = decision_page.page(ROOT)

    assert all(f"/decisions/{record.stem}\n" in page for record in RECORDS.values())


def texts() -> Iterator[tuple[Path, str]]:
    """Sources, pages and catalogues of the repository, without what is built."""
    for top in ROOT.iterdir():
        if top.name.startswith(".") or top.name == "build":
            continue
        for path in top.rglob("*") if top.is_dir() else [top]:
            if path.suffix in {".py", ".md", ".yaml", ".txt", ".toml", ".msg", ".action"} and path.is_file():
                yield path, path.read_text(encoding="utf-8")


def test_every_reference_to_a_decision_leads_to_its_record() -> None:
    records = {number: record.stem for number, record in RECORDS.items()}
    for path, text in texts():
        for number, slug in re.findall(r"decisions/(\d{4})(-[a-z0-9-]*[a-z0-9])?", text):
            assert records.get(int(number), "").startswith(f"{number}{slug}"), f"{path}: decisions/{number}{slug}"
        for number in re.findall(r"[Dd]ecision (\d+)", text):
            assert int(number) in records, f"{path}: decision {number}"


def test_every_link_of_a_page_leads_to_a_file_that_github_has_too() -> None:
    pages = {path: re.sub(r"(?s)```.*?```", "", text) for path, text in texts() if path.suffix == ".md"}
    links = [
        (page, link)
        for page, text in pages.items()
        for link in re.findall(r"\]\((?!\w+:)([^)#\s]+)(?:#[^)\s]*)?\)", text)
        if "generated" not in page.parts
    ]
    assert len(links) > 200
    assert [
        f"{page.relative_to(ROOT)}: {link}"
        for page, link in links
        if not (page.parent / link).exists() or "generated" in (page.parent / link).parts
    ] == []


def test_a_record_has_its_parts_and_each_former_number_is_in_one() -> None:
    former: list[int] = []
    for number, record in RECORDS.items():
        text = record.read_text(encoding="utf-8")
        assert text.startswith(f"# {number}. ")
        assert all(part in text for part in ("**Status.** ", "Context", "Decision")), record.name
        status = text.split("**Status.** ")[1].split("\n\n")[0]
        names = re.search(r"former records? ([^;]*)", status)
        former += map(int, re.findall(r"\b\d{1,3}\b", re.sub(r"\([^)]*\)", "", names[1]))) if names else []

    assert len(former) == len(set(former))
    assert not set(former) & set(RECORDS)


@pytest.mark.parametrize(
    ("docstring", "restructured"),
    [
        ("A `name` and 2 * 3.", r"A ``name`` and 2 \* 3."),
        ("Makes `Check`s.", r"Makes ``Check``\ s."),
        ("Ends in an underscore_ here.", r"Ends in an underscore\_ here."),
        ("Rules:\n1. One,\n   still one.\n2. Two.\nAfter.", "Rules:\n\n1. One,\n   still one.\n2. Two.\n\nAfter."),
        ("- One.\n- Two.\nAfter.", "- One.\n- Two.\n\nAfter."),
        ("Text:\n    indented\nText.", "Text:\n\n    indented\n\nText."),
    ],
)
def test_a_docstring_becomes_restructured_text(docstring: str, restructured: str) -> None:
    assert "\n".join(converted(docstring.splitlines())) == restructured


@pytest.mark.parametrize(
    "text",
    [
        '<script defer src="https://cdn.example/a.js"></script>',
        '<link rel="stylesheet" href="//fonts.example/b.css">',
        "<img alt='' src=http://pictures.example/c.png>",
        "@font-face { src: local('F'), url('https://fonts.example/d.woff2') }",
        '@import "https://styles.example/e.css";',
    ],
)
def test_what_a_page_would_load_from_the_network_is_found_and_named(tmp_path: Path, text: str) -> None:
    page = tmp_path / "page.html"
    page.write_text(text, encoding="utf-8")

    with pytest.raises(ValueError, match=r"page\.html: (http:|https:)?//\w+\.example/"):
        offline.check(tmp_path)


def test_links_to_read_and_own_files_are_no_loads(tmp_path: Path) -> None:
    text = '<a href="https://example.org">x</a><img src="_images/a.png"><link href="_static/b.css"><svg xmlns="http://w3"/>'
    (tmp_path / "page.html").write_text(text, encoding="utf-8")

    offline.check(tmp_path)


def test_no_picture_of_the_docs_loads_from_the_network() -> None:
    offline.check(ROOT / "docs")


def test_a_documented_name_links_to_the_line_of_its_definition() -> None:
    link = source_pages.link("py", {"module": "canbase_config.errors", "fullname": "Problem"})

    assert link is not None
    page, _, line = link.removeprefix("../../source/").partition(".html#L-")
    assert (ROOT / page).read_text(encoding="utf-8").splitlines()[int(line) - 1] == "class Problem:"
    assert source_pages.link("py", {"module": "canbase_config.errors", "fullname": "no_such_name"}) is None
    assert source_pages.link("py", {"module": "typing", "fullname": "Any"}) is None
