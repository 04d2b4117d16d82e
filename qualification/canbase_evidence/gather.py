"""Reads what was given, copies it into one folder, and writes page and hashes. The shell around `evidence.py`."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from canbase_config.commissioned import uncommissioned
from canbase_config.effective import effective
from canbase_config.fingerprint import configuration_sha256
from canbase_config.load import Loaded
from canbase_doctor.careful_read import names
from canbase_evidence import commissioning_proof, drive_identities, hash_list, hazard_results, qualification_report
from canbase_evidence import recorded_stops as recorded
from canbase_evidence.evidence import BOM, Evidence, as_json
from canbase_evidence.evidence_page import page
from canbase_evidence.hash_list import hashes
from canbase_evidence.installed_code import code_sha256
from canbase_evidence.junit_results import Case, JUnitError, read_cases
from canbase_evidence.new_folder import Folder, GatherError, taken
from canbase_evidence.qualification_report import ALL_FILES, REPORT, ThisRobot
from canbase_evidence.software import Software
from canbase_evidence.standing import Finding, Part, Standing
from canbase_hazards import catalogue
from canbase_qualification.software import software as qualification_software
from canbase_recording.input_lines import NoInputsError
from canbase_recording.replay_file import INPUTS_SUFFIX
from canbase_recording.stop_file import read_stop
from canbase_runtime.version import installed_version

INDEX: Final = "index.html"
DATA: Final = "evidence.json"
MOST_RECORDINGS: Final = 1000
_COMPILED: Final = " (compiled)"


@dataclass(frozen=True, slots=True)
class Sources:
    """What to take. A path that was named and cannot be read is a GatherError, never a gap."""

    qualification: Path | None = None
    tests: Sequence[Path] = ()
    recordings: Sequence[Path] = ()
    """Folders with black boxes, or single .asc files."""
    commissioning: Sequence[Path] = ()
    """Reports of `canbase setup commission`."""
    scan: Path | None = None
    """What `canbase bus scan --json` printed."""


def reports_beside(loaded: Loaded) -> list[Path]:
    """The reports of `canbase setup commission`, where it writes them by default: beside robot.yaml."""
    return sorted(loaded.path.parent.glob(f"commissioning-{loaded.robot.name}-*.md"))


def gather(loaded: Loaded, sources: Sources, software: Software, made: str, out: Path) -> Evidence:
    """Writes the folder `out`, whole or not at all. Raises GatherError, and OSError where it cannot be written."""
    out.parent.mkdir(parents=True, exist_ok=True)
    part = Path(tempfile.mkdtemp(prefix=f".{out.name}.", dir=out.parent))
    try:
        evidence = _fill(Folder(part), loaded, sources, software, made)
        part.chmod(0o755)
        os.rename(part, out)  # fails where `out` is a folder with something in it
    except BaseException:
        shutil.rmtree(part, ignore_errors=True)
        raise
    return evidence


def _fill(folder: Folder, loaded: Loaded, sources: Sources, software: Software, made: str) -> Evidence:
    robot, sha256 = loaded.robot, configuration_sha256(loaded.robot)
    _copy_configuration(folder, loaded)
    cases = [case for path in sources.tests for case in _cases(folder, path)]
    hazards = hazard_results.hazard_results(catalogue.load(), cases, code_sha256())
    folder.put("tests", catalogue.FILE.name, catalogue.FILE.read_bytes())
    computing = qualification_software()
    this = ThisRobot(sha256, f"{computing.canbase}, sources {computing.sources}")
    nodes = drive_identities.node_identities(robot, _scan(folder, sources.scan))
    stops = [recorded.judged(stop, robot, installed_version()) for stop in _recordings(folder, sources.recordings)]
    reports = [folder.copy("commissioning", path) for path in sources.commissioning]
    if software.bom:
        folder.put("", BOM, software.bom.encode())
    findings = (
        *_configuration(loaded, sha256),
        hazard_results.finding(hazards, bool(sources.tests)),
        _qualification(folder, sources.qualification, this),
        *commissioning_proof.findings(robot),
        *_reports(reports),
        *drive_identities.findings(nodes, sources.scan is not None),
        *recorded.findings(stops),
        software.finding,
    )
    evidence = Evidence(
        robot=robot.name,
        configuration_sha256=sha256,
        made=made,
        findings=findings,
        hazards=hazards,
        steps=commissioning_proof.step_proofs(robot),
        nodes=nodes,
        stops=tuple(stops),
        versions=software.versions,
        files=hashes(folder.root),
    )
    _write_pages(folder, evidence)
    return evidence


def _write_pages(folder: Folder, evidence: Evidence) -> None:
    folder.put("", DATA, (json.dumps(as_json(evidence), indent=1, ensure_ascii=False) + "\n").encode())
    folder.put("", INDEX, page(evidence).encode())
    folder.put("", hash_list.NAME, hash_list.text_of(hashes(folder.root)).encode())


def _copy_configuration(folder: Folder, loaded: Loaded) -> None:
    folder.put("configuration", "robot.yaml", taken(loaded.path.resolve()))
    folder.put("configuration", "effective.yaml", effective(loaded).encode())
    for path in sorted({path.resolve() for path in loaded.files.values()}):
        folder.put("configuration", path.name, taken(path))


def _configuration(loaded: Loaded, sha256: str) -> list[Finding]:
    """The warnings of robot.yaml are open points, too; whether it is commissioned is a part of its own."""
    here = f"robot.yaml of {loaded.robot.name}, SHA-256 of the effective configuration {sha256[:12]}…"
    apart = uncommissioned(loaded.robot)
    warnings = [each for each in loaded.warnings if not apart or not each.what.startswith(apart)]
    return [
        Finding(Part.CONFIGURATION, Standing.PRESENT, here),
        *(Finding(Part.CONFIGURATION, Standing.INCOMPLETE, f"{each.key}: {each.what}", each.hint) for each in warnings),
    ]


def _cases(folder: Folder, path: Path) -> tuple[Case, ...]:
    content = taken(path)
    folder.put("tests", path.name, content)
    try:
        return read_cases(content.decode("utf-8"))
    except (JUnitError, UnicodeDecodeError) as error:
        raise GatherError(f"--tests {path}: {error}") from error


def _scan(folder: Folder, path: Path | None) -> Sequence[Mapping[str, Any]] | None:
    if path is None:
        return None
    content = taken(path)
    folder.put("drives", path.name, content)
    try:
        told = json.loads(content)
        if isinstance(told, list) and all(isinstance(row, dict) for row in told):
            return told
    except (ValueError, RecursionError) as error:
        raise GatherError(f"--scan {path}: no JSON: {error}") from error
    raise GatherError(f"--scan {path}: it is not what canbase bus scan --json prints")


def _qualification(folder: Folder, path: Path | None, this: ThisRobot) -> Finding:
    if path is None:
        return qualification_report.finding(None, None, this)
    if not path.is_dir():
        raise GatherError(f"--qualification {path}: there is no such folder")
    there = [name for name in names(path) if name in ALL_FILES]
    for name in there:
        folder.copy("qualification", path / name)
    return qualification_report.finding(_report(path / REPORT) if REPORT in there else None, there, this)


def _report(path: Path) -> Mapping[str, Any] | None:
    try:
        told = json.loads(taken(path))
    except (ValueError, RecursionError):
        return None
    return told if isinstance(told, dict) else None


def _reports(files: Sequence[str]) -> list[Finding]:
    """Texts for people; the marks in robot.yaml are what counts."""
    if files:
        told = f"{len(files)} reports of canbase setup commission, not judged here: {', '.join(files)}."
        return [Finding(Part.COMMISSIONING, Standing.PRESENT, told)]
    told, cure = "No report of a commissioning was given.", "--commissioning FILE: commissioning-….md"
    return [Finding(Part.COMMISSIONING, Standing.MISSING, told, cure)]


def _recordings(folder: Folder, paths: Sequence[Path]) -> list[recorded.RecordedStop]:
    files = [file for path in paths for file in _asc_files(path)]
    if len(files) > MOST_RECORDINGS:
        raise GatherError(f"--recordings: {len(files)} recordings, {MOST_RECORDINGS} at most")
    for path in paths:
        _copy_inputs(folder, path)
    return sorted((_recording(folder, file) for file in files), key=lambda stop: (stop.at_unix_s, stop.file))


def _copy_inputs(folder: Folder, path: Path) -> None:
    """What watchdog, mux and filter recorded of their own inputs: `canbase record replay` finds it beside the stops."""
    for name in names(path) if path.is_dir() else ():
        if name.endswith(INPUTS_SUFFIX):
            folder.copy("recordings", path / name)


def _asc_files(path: Path) -> list[Path]:
    if not path.is_dir():
        return [path]
    try:
        found = [path / name for name in names(path) if name.endswith(".asc")]
    except OSError as error:
        raise GatherError(f"--recordings {path}: {error.strerror}") from error
    if not found:
        raise GatherError(f"--recordings {path}: no .asc file of a black box in it")
    return found


def _recording(folder: Folder, path: Path) -> recorded.RecordedStop:
    """Both files of one stop are copied; what is read is the copy."""
    name = folder.copy("recordings", path)
    beside = path.with_suffix(".json")
    if not beside.exists():
        return _unusable(name, "without its .json file")
    copy = folder.root / name
    folder.put("recordings", copy.with_suffix(".json").name, taken(beside))
    try:
        stop = read_stop(copy)
        return recorded.RecordedStop(
            file=name,
            at_unix_s=stop.at_s + stop.wall_offset_s,
            stopped_by=stop.stopped_by,
            cause=stop.cause,
            detail=stop.detail,
            version=stop.versions["canbase"].removesuffix(_COMPILED),
            robot=stop.robot,
        )
    except (NoInputsError, KeyError):
        return _unusable(name, "with a .json file that is not one of this canbase")


def _unusable(name: str, why: str) -> recorded.RecordedStop:
    return recorded.RecordedStop(name, 0.0, "", "", "", "", None, why)
