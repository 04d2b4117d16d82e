"""What a support bundle hides, wherever in a line it stands, and what it must leave as it is."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from canbase_config.load import sample
from canbase_doctor.redact import HIDDEN, cleaned

KEY = "-----BEGIN EC PRIVATE KEY-----\nMHcCAQEE\n-----END EC PRIVATE KEY-----\n"
JOURNAL = """\
Nov 22 10:00:01.123456 robot canbase-watchdog[812]: ready: no lease yet, bus can0 at 500000 bit/s, cause=none
Nov 22 10:00:02.000001 robot motor_driver[813]: [INFO] [1763.25] [motor_driver]: operational: left_wheel (node 1)
Nov 22 10:00:03.000000 robot systemd[1]: systemd-ask-password-wall.path: Deactivated successfully.
Nov 22 10:00:04.000000 robot kernel: Key type asymmetric registered; Loaded X.509 cert 'Debian Secure Boot CA: 6ccece7e'
Nov 22 10:00:04.500000 robot sshd[7]: 12 tests passed: 3, bypass=on, compass: 12, PASSED=1, Failed password for root
Nov 22 10:00:04.600000 robot nav[9]: see https://host:8080/path, mail me@host, basic setup --tokenize 3, user --help
Nov 22 10:00:05.000000 robot nav[9]: in auth::token::parse, tokens_left == 3, see https://x/token://y
"""
SHOW = """\
Id=canbase-driver@robot.service
Environment=PYTHONFAULTHANDLER=1 "PYTHONPATH=/opt/my ros:/opt/ws"
EnvironmentFiles=/etc/canbase/robot.env (ignore_errors=no)
ExecStart={ path=/opt/canbase/bin/python ; argv[]=/opt/canbase/bin/python -m canbase_cli driver ; status=0/0 }
KeyringMode=private
PrivateDevices=yes
LoadCredential=
"""


@pytest.mark.parametrize(
    ("line", "clean"),
    [
        ("wifi_password: hunter2", f"wifi_password: {HIDDEN}"),
        ("API_KEY=abc def", f"API_KEY={HIDDEN}"),
        ("  token = xyz", f"  token = {HIDDEN}"),
        ("Secret: 1", f"Secret: {HIDDEN}"),
        ("export WIFI_PASSPHRASE=a,b c", f"export WIFI_PASSPHRASE={HIDDEN}"),
        ("wifi: {user: x, password: two words, band: 5}", f"wifi: {{user: x, password: {HIDDEN}, band: 5}}"),
        ("wifi: {password: 'a, b}', user: x}", f"wifi: {{password: '{HIDDEN}', user: x}}"),
        ("Environment=A=1 TOKEN=abc,d B=2", f"Environment=A=1 TOKEN={HIDDEN} B=2"),
        ('Environment=A=1 "WIFI_PASSWORD=two words" B=2', f'Environment=A=1 "WIFI_PASSWORD={HIDDEN}" B=2'),
        ("Nov 22 10:00 nav[1]: private key: abc, next", f"Nov 22 10:00 nav[1]: private key: {HIDDEN} next"),
        ("Nov 22 10:00 nav[1]: login with api-key=abc ok", f"Nov 22 10:00 nav[1]: login with api-key={HIDDEN} ok"),
        ("credentials: [abc, def]", f"credentials: {HIDDEN}"),
        ("GET http://x/y?api_token=abc HTTP/1.1", f"GET http://x/y?api_token={HIDDEN} HTTP/1.1"),
        ("secret: |\n  one\n  two", f"secret: {HIDDEN}\n  {HIDDEN}"),
        ("my_tokens:\n  - one\n  - two", f"my_tokens:\n  {HIDDEN}"),
        ("DB_PASS=hunter2", f"DB_PASS={HIDDEN}"),
        ("MQTT_PWD: hunter2", f"MQTT_PWD: {HIDDEN}"),
        ('  psk="correct horse"', f'  psk="{HIDDEN}"'),
        ("802-11-wireless-security.psk:  hunter2", f"802-11-wireless-security.psk:  {HIDDEN}"),
        ("    wpa-psk correct horse", f"    wpa-psk {HIDDEN}"),
        ("machine host login me password hunter2", f"machine host login me password {HIDDEN}"),
        ("origin https://user:pw@host/x.git (fetch)", f"origin https://{HIDDEN}@host/x.git (fetch)"),
        ("amqp://me:p@ss@host:5672", f"amqp://{HIDDEN}@host:5672"),
        ("clone https://ghp_abc@github.com/x", f"clone https://{HIDDEN}@github.com/x"),
        ("Authorization: Bearer abc.def-ghi", f"Authorization: {HIDDEN}"),
        ("curl -H 'Authorization: Basic dXNlcg==' https://x", f"curl -H 'Authorization: {HIDDEN}' https://x"),
        ('{"authorization": "Digest a=b, c=d", "n": 1}', f'{{"authorization": "{HIDDEN}", "n": 1}}'),
        ("Nov 22 x[1]: sent bearer abcdefghij to host", f"Nov 22 x[1]: sent bearer {HIDDEN} to host"),
        ("Cookie: session=abc; other=def", f"Cookie: {HIDDEN}"),
        ("argv: mysql --password hunter2 --host db", f"argv: mysql --password {HIDDEN} --host db"),
        ("argv: x --db-pass 'two words' -v", f"argv: x --db-pass {HIDDEN} -v"),
        ('["x", "--token", "hunter2", "-v"]', f'["x", "--token", {HIDDEN}, "-v"]'),
        ("curl --user me:hunter2 https://x", f"curl --user me:{HIDDEN} https://x"),
        ("sshpass -p hunter2 ssh host", f"sshpass -p {HIDDEN} ssh host"),
        ("got AKIAIOSFODNN7EXAMPLE today", f"got {HIDDEN} today"),
        ('password: "one\n  two\n three"', f'password: "{HIDDEN}"'),
        ("export DB_PASS='one\ntwo'", f"export DB_PASS='{HIDDEN}'"),
        ("password: one\n  two\n  three", f"password: {HIDDEN}"),
        ("DB_PASSWORD=one\\\ntwo", f"DB_PASSWORD={HIDDEN}"),
    ],
)
def test_values_that_look_like_secrets_are_hidden_and_their_names_stay(line: str, clean: str) -> None:
    assert cleaned(f"a: 1\n{line}\nb: 2\n") == f"a: 1\n{clean}\nb: 2\n"


@pytest.mark.parametrize("value", ["hunter2", 'a "quoted" one', "back\\slash", "two words, and more"])
@pytest.mark.parametrize("key", ["password", "user_token", "API key"])
def test_json_stays_json_also_within_a_message_of_json(key: str, value: str) -> None:
    inner = json.dumps({"user": "x", key: value, "n": 1})
    line = json.dumps({"MESSAGE": inner, key: value, "PRIORITY": "6"})

    seen = json.loads(cleaned(line))

    assert (seen[key], seen["PRIORITY"]) == (HIDDEN, "6")
    assert json.loads(seen["MESSAGE"]) == {"user": "x", key: HIDDEN, "n": 1}


def test_a_private_key_whose_begin_was_cut_off_is_hidden_too() -> None:
    assert cleaned(f"{KEY[40:]}after\n{KEY}") == f"{HIDDEN}\nafter\n{HIDDEN}\n"
    assert cleaned("no key at all\n") == "no key at all\n"


def test_a_quote_that_is_never_closed_hides_its_line_alone() -> None:
    text = 'password: "one\n' + "next: 1\n" * 30

    assert cleaned(text) == f'password: "{HIDDEN}\n' + "next: 1\n" * 30


def test_a_private_key_is_cut_out_even_without_its_end() -> None:
    assert cleaned(f"before\n{KEY}after") == f"before\n{HIDDEN}\nafter"
    assert "MHcC" not in cleaned(KEY[:45])
    assert "MHcC" not in cleaned(json.dumps({"MESSAGE": KEY}))


@pytest.mark.parametrize(
    "text",
    [
        *(pytest.param(path.read_text(), id=path.name) for path in sorted(sample("bench").parent.glob("*.yaml"))),
        pytest.param(JOURNAL, id="journal"),
        pytest.param(json.dumps({"MESSAGE": JOURNAL, "PRIORITY": 6}), id="journal.json"),
        pytest.param(SHOW, id="systemctl show"),
        pytest.param("tokenize-rt==6.1.0\ncryptography==43.0\n", id="pip"),
        pytest.param("password:\nb: 2\n", id="no value"),
        pytest.param('{"password": "", "token": \'\'}\n', id="empty value"),
        *(pytest.param(path.read_text(), id=path.name) for path in sorted(Path(__file__).parents[3].glob("docs/*.md"))),
    ],
)
def test_where_there_is_no_secret_nothing_is_changed(text: str) -> None:
    assert cleaned(text) == text


@pytest.mark.timeout(20)
@pytest.mark.parametrize("unit", ["token", "{", '"', " ", "\\", "-----BEGIN PRIVATE KEYS"])
def test_no_text_holds_it_up(unit: str) -> None:
    assert cleaned(unit * 100_000) == unit * 100_000


@pytest.mark.timeout(20)
@pytest.mark.parametrize(
    "unit",
    ["a://", "a://b@", "--password ", "bearer ", "psk=\n", "psk='\n", "a: \n", "cookie:", "-----END PRIVATE KEYS"],
)
def test_the_work_grows_no_faster_than_the_text(unit: str) -> None:
    """A pattern that tries again and again would take hours of this."""
    assert len(cleaned(unit * 30_000)) <= (len(unit) + 2 * len(HIDDEN)) * 30_000
