"""index.html of a folder of evidence: one file that opens without a network. What is missing comes first. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from datetime import datetime, timezone
from typing import Final

from canbase_evidence.drive_identities import words
from canbase_evidence.evidence import BOM, DISCLAIMER, Evidence
from canbase_evidence.hash_list import NAME
from canbase_evidence.hazard_results import HazardResult, Proof, Result
from canbase_evidence.standing import Finding, Part, Standing
from canbase_hazards.catalogue import Part as HazardPart
from canbase_recording import html_page
from canbase_recording.html_page import Html, bullets, marked, row, section, table, tag, terms

_RESULT_TONES: Final = {Result.PASSED: "good", Result.FAILED: "bad", Result.NOT_RUN: "warn", Result.SKIPPED: "warn"}


def page(evidence: Evidence) -> str:
    """The whole page."""
    facts = [("robot", evidence.robot), ("configuration, SHA-256", evidence.configuration_sha256)]
    facts += [("made", evidence.made), *evidence.versions.items()]
    missing = _findings(evidence.open) or tag("p", "Nothing is missing, and nothing failed.")
    main = [
        section("not", "What this is not", *(tag("p", each) for each in DISCLAIMER), class_="not"),
        section("open", "What is missing, failed or not of this robot", missing, class_="open"),
        section("here", "What is here", _findings(evidence.here) or tag("p", "Nothing.")),
        section("about", "What it is about", terms(facts)),
        *(_section(evidence, part) for part in Part),
        section("files", "Files", *_files(evidence)),
    ]
    return html_page.page(f"Evidence: {evidence.robot}", [_verdict(evidence)], main)


def _verdict(evidence: Evidence) -> Html:
    """The first sentence."""
    count = len(evidence.open)
    if not count:
        return tag("p", "Everything that canbase asks for is here, and none of it failed.", class_="verdict good")
    failed = sum(each.standing is Standing.FAILED for each in evidence.open)
    told = f"{count} thing{'s are' if count > 1 else ' is'} missing, failed or not of this robot"
    return tag("p", f"{told}{f'; {failed} failed' if failed else ''}.", class_="verdict bad")


def _findings(found: Iterable[Finding]) -> Html:
    return bullets(Html("".join(_finding(each))) for each in found)


def _finding(found: Finding) -> Iterator[Html]:
    yield _badge(found.standing.value, "good" if found.standing.counts else "bad")
    yield tag("b", f" {found.part.value}: ")
    yield html_page.escaped(found.sentence)
    if found.cure:
        yield tag("div", f"To add it: {found.cure}", class_="soft")


def _badge(text: str, tone: str) -> Html:
    return tag("span", text, class_=f"badge {tone}")


def _section(evidence: Evidence, part: Part) -> Html:
    """The sentences of the first page come before what else it shows."""
    more = _MORE[part](evidence) if part in _MORE else ()
    return section(part.name.lower(), part.value, _findings(evidence.of(part)) or tag("p", "Nothing to report."), *more)


def _hazards(evidence: Evidence) -> Iterator[Html]:
    for part in HazardPart:
        rows = [each for each in evidence.hazards if each.row.part is part]
        counts = {result: sum(each.result is result for each in rows) for result in Result}
        told = ", ".join(f"{count} {result.value}" for result, count in counts.items() if count)
        if rows:
            yield tag("h3", f"{part.heading}: {told}")
        yield from map(_hazard, sorted(rows, key=lambda each: list(Result).index(each.result)))


def _hazard(found: HazardResult) -> Html:
    hazard = found.row
    facts = [("must hold", hazard.constraint), ("component", hazard.layer), ("reaction", hazard.reaction)]
    facts += [("not covered", hazard.not_covered)] if hazard.not_covered else []
    head = tag("summary", _badge(found.result.value, _RESULT_TONES[found.result]), f" {hazard.failure}")
    what = tag("p", hazard.unsafe_control_action)
    return tag("details", head, what, terms(facts), bullets(map(_proof, found.proofs)), id=hazard.id)


def _proof(proof: Proof) -> Html:
    badge = _badge(proof.result.value, _RESULT_TONES[proof.result])
    return Html(f"{badge} {tag('code', proof.name)} {tag('span', proof.why, class_='soft')}")


def _steps(evidence: Evidence) -> Iterator[Html]:
    rows = (row(each.step, each.shows, _standing(each.standing)) for each in evidence.steps)
    yield table(("step", "shows", "mark in robot.yaml"), rows)


def _nodes(evidence: Evidence) -> Iterator[Html]:
    rows = (row(n.node_id, n.joints, n.profile, words(n.expected), words(n.read)) for n in evidence.nodes)
    yield table(("node", "joints", "profile", "expected by robot.yaml", "read by a scan"), rows)


def _stops(evidence: Evidence) -> Iterator[Html]:
    rows = [
        row(_time(each.stop.at_unix_s), each.stop.stopped_by, each.stop.cause, each.stop.detail, each.stop.file,
            f"{_standing(each.standing)}{': ' if each.why else ''}{each.why}")
        for each in evidence.stops
    ]  # fmt: skip
    if rows:
        yield table(("time", "stopped by", "cause", "detail", "file", "counts"), rows)


def _standing(standing: Standing) -> str:
    return "counts" if standing.counts else standing.value


def _time(unix_s: float) -> str:
    try:
        return datetime.fromtimestamp(unix_s, timezone.utc).strftime("%Y-%m-%d %H:%M:%S UTC")
    except (ValueError, OverflowError, OSError):
        return "unknown"


def _links(evidence: Evidence, begins: str) -> Iterator[Html]:
    """To the files of one part."""
    return (tag("p", tag("a", name, href=name)) for name in sorted(evidence.files) if name.startswith(begins))


def _files(evidence: Evidence) -> Iterator[Html]:
    yield tag("p", marked(
        f"{NAME} has the hashes of all files, this page included: `canbase prove evidence --check FOLDER`, or "
        f"`sha256sum -c {NAME}`."
    ))  # fmt: skip
    rows = (row(tag("a", name, href=name), tag("code", digest)) for name, digest in sorted(evidence.files.items()))
    yield table(("file", "SHA-256"), rows)


_MORE: Final[Mapping[Part, Callable[[Evidence], Iterator[Html]]]] = {
    Part.HAZARDS: _hazards,
    Part.QUALIFICATION: lambda evidence: _links(evidence, "qualification/"),
    Part.COMMISSIONING: _steps,
    Part.DRIVES: _nodes,
    Part.RECORDINGS: _stops,
    Part.SOFTWARE: lambda evidence: _links(evidence, BOM),
}
