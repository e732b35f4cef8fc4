"""REDbot on every kind of response: `linter.py HOST:PORT`. Fails on whatever it calls bad.

REDbot asks again with conditions, ranges and content codings, so this checks behaviour, not only fields.
"""

import json
import subprocess
import sys
import urllib.request
from configparser import ConfigParser

import thor
from httplint.note import levels
from redbot.resource import HttpResource

ORIGIN = f"http://{sys.argv[1]}"


def notes_of(url):
    config = ConfigParser()
    config.read_dict({"redbot": {"enable_local_access": "True"}})
    resource = HttpResource(config["redbot"])
    resource.set_request(url)

    @thor.events.on(resource)
    def check_done():
        thor.stop()

    resource.check()
    thor.run()
    assert resource.has_response, f"{url}: {resource.fetch_error}"
    return resource.response


def judge(path):
    """Prints what REDbot thinks of one response; its event loop runs once in a process."""
    response = notes_of(ORIGIN + path)
    found = [note for note in response.notes if note.level in (levels.BAD, levels.WARN)]
    bad = [note for note in found if note.level is levels.BAD]
    print(f"{'FAILED' if bad else 'ok':6} {response.status_code} {path}")
    for note in found:
        print(f"       {note.level.value}: {note.summary}")
    sys.exit(1 if bad else 0)


def main():
    if len(sys.argv) > 2:
        judge(sys.argv[2])
    about = json.load(urllib.request.urlopen(f"{ORIGIN}/api/files/scan"))
    paths = [
        "/",
        "/catalogue",
        "/api/catalogue",
        "/api/files/scan",
        "/files/scan.marq",
        about["pages"][0].replace("{first}", "3"),
        about["pages"][1].replace("{first}", "1").replace("{last}", "8"),
        "/health",
        "/metrics",
        "/files/nothing.marq",
    ]
    failed = sum(subprocess.run([sys.executable, __file__, sys.argv[1], path]).returncode != 0 for path in paths)
    print(f"{len(paths)} responses, {failed} with errors, judged by REDbot")
    sys.exit(1 if failed else 0)


main()
