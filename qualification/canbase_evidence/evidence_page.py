"""index.html of a folder of evidence: one file that opens without a network. What is missing comes first. Pure."""

from __future__ import annotations

import html
from collections.abc import Iterable
from datetime import datetime, timezone
from importlib.resources import files
from string import Template
from typing import Final

from canbase_evidence.drive_identities import words
from canbase_evidence.evidence import BOM, DISCLAIMER, Evidence
from canbase_evidence.hash_list import NAME
from canbase_evidence.hazard_results import HazardResult, Proof, Result
from canbase_evidence.standing import Finding, Part, Standing
from canbase_hazards.catalogue import Part as HazardPart
from canbase_runtime.foreign_text import SENTENCE_LENGTH, printable

_TONES: Final = {
    Standing.PRESENT: "good",
    Standing.INCOMPLETE: "bad",
    Standing.MISSING: "bad",
    Standing.STALE: "bad",
    Standing.OTHER: "bad",
    Standing.FAILED: "bad",
}
_RESULT_TONES: Final = {Result.PASSED: "good", Result.FAILED: "bad", Result.NOT_RUN: "warn", Result.SKIPPED: "warn"}
_HEADINGS: Final = {
    HazardPart.PROCESS: "A process",
    HazardPart.BUS_AND_DRIVES: "Bus and drives",
    HazardPart.COMPUTER: "The computer",
    HazardPart.ROS: "ROS",
    HazardPart.OPERATOR: "Operators",
    HazardPart.ACCESS: "Access",
}


def page(evidence: Evidence) -> str:
    """The whole page."""
    template = Template((files("canbase_evidence") / "evidence_page.html").read_text(encoding="utf-8"))
    return template.substitute(
        title=_text(f"Evidence: {evidence.robot}"),
        verdict=_verdict(evidence),
        disclaimer="".join(f"<p>{_text(each)}</p>" for each in DISCLAIMER),
        open=_findings(evidence.open) or "<p>Nothing is missing, and nothing failed.</p>",
        here=_findings(evidence.here) or "<p>Nothing.</p>",
        facts=_facts(evidence),
        sections="".join(_section(part, body) for part, body in _bodies(evidence).items()),
        files=_files(evidence),
    )


def _text(text: object, length: int = SENTENCE_LENGTH) -> str:
    """One line of anybody's text, as text of the page."""
    return html.escape(printable(text, length))


def _verdict(evidence: Evidence) -> str:
    """The first sentence."""
    count = len(evidence.open)
    if not count:
        return '<p class="verdict good">Everything that canbase asks for is here, and none of it failed.</p>'
    failed = sum(each.standing is Standing.FAILED for each in evidence.open)
    told = f"{count} thing{'s are' if count > 1 else ' is'} missing, failed or not of this robot"
    return f'<p class="verdict bad">{told}{f"; {failed} failed" if failed else ""}.</p>'


def _findings(found: Iterable[Finding]) -> str:
    items = "".join(
        f'<li><span class="badge {_TONES[each.standing]}">{each.standing.value}</span> '
        f"<b>{each.part.value}:</b> {_text(each.sentence)}{_cure(each)}</li>"
        for each in found
    )
    return f"<ul>{items}</ul>" if items else ""


def _cure(finding: Finding) -> str:
    return f'<div class="soft">To add it: {_text(finding.cure)}</div>' if finding.cure else ""


def _facts(evidence: Evidence) -> str:
    rows = [("robot", evidence.robot), ("configuration, SHA-256", evidence.configuration_sha256)]
    rows += [("made", evidence.made), *evidence.versions.items()]
    return f"<dl>{''.join(f'<dt>{_text(name)}</dt><dd>{_text(value)}</dd>' for name, value in rows)}</dl>"


def _bodies(evidence: Evidence) -> dict[Part, str]:
    """What each section shows; the sentences of the first page come before it."""
    own = {Part.HAZARDS: _hazards(evidence), Part.COMMISSIONING: _steps(evidence), Part.DRIVES: _nodes(evidence),
           Part.RECORDINGS: _stops(evidence),
           Part.QUALIFICATION: _links(evidence, "qualification/"),
           Part.SOFTWARE: _links(evidence, BOM)}  # fmt: skip
    return {part: (_findings(evidence.of(part)) or "<p>Nothing to report.</p>") + own.get(part, "") for part in Part}


def _section(part: Part, body: str) -> str:
    return f'<section id="{part.name.lower()}"><h2>{part.value}</h2>{body}</section>'


def _hazards(evidence: Evidence) -> str:
    parts = []
    for part, heading in _HEADINGS.items():
        rows = [each for each in evidence.hazards if each.row.part is part]
        worst_first = sorted(rows, key=lambda each: list(Result).index(each.result))
        parts.append(f"<h3>{heading}: {_counts(rows)}</h3>{''.join(map(_hazard, worst_first))}" if rows else "")
    return "".join(parts)


def _counts(rows: list[HazardResult]) -> str:
    counts = {result: sum(each.result is result for each in rows) for result in Result}
    return ", ".join(f"{count} {result.value}" for result, count in counts.items() if count)


def _hazard(found: HazardResult) -> str:
    row = found.row
    facts = [("must hold", row.constraint), ("component", row.layer), ("reaction", row.reaction)]
    facts += [("not covered", row.not_covered)] if row.not_covered else []
    told = "".join(f"<dt>{name}</dt><dd>{_text(value)}</dd>" for name, value in facts)
    tests = "".join(map(_proof, found.proofs))
    return (
        f'<details id="{_text(row.id)}"><summary>{_badge(found.result)} {_text(row.failure)}</summary>'
        f"<p>{_text(row.unsafe_control_action)}</p><dl>{told}</dl><ul>{tests}</ul></details>"
    )


def _proof(proof: Proof) -> str:
    why = f' <span class="soft">{_text(proof.why)}</span>' if proof.why else ""
    return f"<li>{_badge(proof.result)} <code>{_text(proof.name)}</code>{why}</li>"


def _badge(result: Result) -> str:
    return f'<span class="badge {_RESULT_TONES[result]}">{result.value}</span>'


def _steps(evidence: Evidence) -> str:
    rows = [(each.step, each.shows, _standing(each.standing)) for each in evidence.steps]
    return _table(("step", "shows", "mark in robot.yaml"), rows)


def _nodes(evidence: Evidence) -> str:
    rows = [(str(each.node_id), each.joints, each.profile, words(each.expected), words(each.read))
            for each in evidence.nodes]  # fmt: skip
    return _table(("node", "joints", "profile", "expected by robot.yaml", "read by a scan"), rows)


def _stops(evidence: Evidence) -> str:
    rows = [(_time(each.stop.at_unix_s), each.stop.stopped_by, each.stop.cause, each.stop.detail, each.stop.file,
             f"{_standing(each.standing)}{': ' if each.why else ''}{each.why}") for each in evidence.stops]  # fmt: skip
    return _table(("time", "stopped by", "cause", "detail", "file", "counts"), rows) if rows else ""


def _standing(standing: Standing) -> str:
    return "counts" if standing.counts else standing.value


def _time(unix_s: float) -> str:
    try:
        return datetime.fromtimestamp(unix_s, timezone.utc).strftime("%Y-%m-%d %H:%M:%S UTC")
    except (ValueError, OverflowError, OSError):
        return "unknown"


def _links(evidence: Evidence, begins: str) -> str:
    """To the files of one part."""
    names = [html.escape(name) for name in sorted(evidence.files) if name.startswith(begins)]
    links = ", ".join(f'<a href="{name}">{name}</a>' for name in names)
    return f"<p>{links}</p>" if links else ""


def _files(evidence: Evidence) -> str:
    rows = "".join(
        f'<tr><td><a href="{html.escape(name)}">{_text(name)}</a></td><td class="mono">{digest}</td></tr>'
        for name, digest in sorted(evidence.files.items())
    )
    told = f"{NAME} has the hashes of all files, this page included: <code>canbase prove evidence --check FOLDER</code>"
    return f"<p>{told}, or <code>sha256sum -c {NAME}</code>.</p>{_scroll(('file', 'SHA-256'), rows)}"


def _table(columns: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    body = "".join(f"<tr>{''.join(f'<td>{_text(cell)}</td>' for cell in row)}</tr>" for row in rows)
    return _scroll(columns, body)


def _scroll(columns: tuple[str, ...], body: str) -> str:
    head = "".join(f'<th scope="col">{column}</th>' for column in columns)
    return f'<div class="scroll" tabindex="0"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'
