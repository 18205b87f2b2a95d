"""wandb itself, online, with a server that dies while a run goes on."""

import json
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from tests.command import KEYS, ship_trl

LINE = ("profile=smoke", "target=1", "method=scratch", "logger=wandb", "wandb.mode=online")


class Server(ThreadingHTTPServer):
    """As much of wandb's server as begins a run and takes its rows."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Request)
        self.begun = self.streamed = 0
        self.rows: list[dict[str, Any]] = []
        # So many requests that bring rows are answered; after them none is.
        self.lives = 1000

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Stay silent: wandb hangs up as it likes."""

    def answer(self, query: str, variables: dict[str, Any]) -> dict[str, Any]:
        """Answer a query as wandb's server does."""
        if "upsertBucket" in query:
            self.begun += 1
            project = {"id": "p", "name": "ship_trl", "entity": {"id": "e", "name": "me"}}
            bucket = {"id": "b", "name": variables["name"], "displayName": "run", "project": project}
            return {"upsertBucket": {"bucket": {**bucket, "historyLineCount": 0}, "inserted": True}}
        if "createRunFiles" in query:
            files = [{"name": name, "uploadUrl": f"{self.url}/{name}"} for name in variables["files"]]
            return {"createRunFiles": {"runID": "b", "uploadHeaders": [], "files": files}}
        viewer = {"id": "u", "entity": "me", "username": "me", "flags": "{}", "teams": {"edges": []}}
        return {"viewer": viewer, "serverInfo": {"features": []}, "model": {"bucket": None}}

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}"


class Request(BaseHTTPRequestHandler):
    server: Server

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"] or 0))
        server = self.server
        if server.streamed >= server.lives:
            return
        if self.path.endswith("/graphql"):
            asked = json.loads(body)
            self.reply({"data": server.answer(asked["query"], asked.get("variables") or {})})
        else:
            if self.path.endswith("/file_stream"):
                server.streamed += 1
                history = json.loads(body).get("files", {}).get("wandb-history.jsonl", {})
                server.rows += map(json.loads, history.get("content", []))
            self.reply({"limits": {}})

    def do_PUT(self) -> None:
        self.rfile.read(int(self.headers["Content-Length"] or 0))
        self.reply({})

    def reply(self, values: dict[str, Any]) -> None:
        data = json.dumps(values).encode()
        self.send_response(200)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)

    def log_request(self, *_: Any) -> None:
        """Print nothing."""


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    with Server() as found:
        monkeypatch.setenv("WANDB_BASE_URL", found.url)
        monkeypatch.setenv("WANDB_API_KEY", KEYS["WANDB_API_KEY"])
        threading.Thread(target=found.serve_forever, daemon=True).start()
        yield found
        found.shutdown()


def test_a_run_is_uploaded(server: Server, tmp_path: Path) -> None:
    said = ship_trl(*LINE, folder=tmp_path).stdout
    trained = [row["episode"] for row in server.rows if "train/return" in row]
    assert trained == list(range(1, 1 + len(trained))) and len(trained) > 1
    assert f"wandb: {server.url}/me/ship_trl/runs/" in said and "wandb sync" not in said


def test_a_server_that_dies_ends_no_training(server: Server, tmp_path: Path) -> None:
    server.lives = 1
    # In place of two minutes.
    first = "from ship_trl.run import wandb_tracker; wandb_tracker.FINISH_TIMEOUT = 2.0"
    said = ship_trl(*LINE, folder=tmp_path, first=first).stdout
    assert server.begun and server.streamed == 1
    (folder,) = (tmp_path / "outputs/smoke/wandb").glob("run-*")
    name = folder.relative_to(tmp_path)
    assert "wandb: Timed out finishing run; the run goes on without it\n" in said
    assert f"wandb: {name}; to upload it: wandb sync {name}\n" in said
    assert (tmp_path / "outputs/smoke/1/scratch/seed=0/result.json").is_file()
